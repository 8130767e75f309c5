// Method: the tree halves the faces at the median of their centroids along the longest side of their box, down to four. Nearest places by
//   branch and bound; boxes of two meshes by the fifteen separating axes.
// Source: C. Ericson, "Real-Time Collision Detection" (2005), 5.1.5 (nearest point of a triangle), 4.4 (boxes), 6.1 (trees); T. Moeller and
//   B. Trumbore, "Fast, minimum storage ray-triangle intersection" (1997).
// Deviations: none.
#include "runtime/contact/mesh.hpp"

#include <algorithm>
#include <cmath>

#include "runtime/bank/edges.hpp"
#include "runtime/bank/triangle.hpp"

namespace carillon::contact {
namespace {

using SimTK::cross;
using SimTK::dot;
using SimTK::Vec2;
using SimTK::Vec3;

constexpr int kLeaf = 4;         // faces
constexpr double kSame = 1e-13;  // relative: distances that are equal

/// Barycentric coordinates of the place of a triangle that is nearest to x.
Vec3 find_nearest_barycentric(const Vec3& x, const Vec3& a, const Vec3& b, const Vec3& c) {
  const Vec3 ab = b - a, ac = c - a, ax = x - a, bx = x - b, cx = x - c;
  const auto w = bank::weigh_corners(dot(ab, ax), dot(ac, ax), dot(ab, bx), dot(ac, bx), dot(ab, cx), dot(ac, cx));
  return {w[0], w[1], w[2]};
}

}  // namespace

std::vector<std::int32_t> find_opposite_edges(const std::vector<Face>& triangles, std::size_t vertices) {
  std::vector<std::int32_t> opposite(3 * triangles.size(), -1);
  bank::for_each_edge(triangles, vertices, [&](std::int32_t low, const bank::HalfEdge* first, const bank::HalfEdge* last) {
    const auto begins_low = [&](const bank::HalfEdge& edge) { return triangles[edge.number / 3][edge.number % 3] == low; };
    const bool is_edge = low != first->upper;
    if (last - first == 1 && is_edge) return;
    if (last - first == 2 && is_edge && begins_low(first[0]) != begins_low(first[1])) {
      opposite[first[0].number] = first[1].number;
      opposite[first[1].number] = first[0].number;
      return;
    }
    for (const bank::HalfEdge* edge = first; edge < last; ++edge) opposite[edge->number] = -2;
  });
  return opposite;
}

bool Box::contains(const Vec3& x) const {
  for (int k = 0; k < 3; ++k)
    if (x[k] < low[k] || x[k] > high[k]) return false;
  return true;
}

double Box::calc_distance2(const Vec3& x) const {
  double sum = 0.0;
  for (int k = 0; k < 3; ++k) {
    const double out = std::max({low[k] - x[k], x[k] - high[k], 0.0});
    sum += out * out;
  }
  return sum;
}

bool are_boxes_near(const Box& a, const Box& b, const SimTK::Transform& X_ba, double margin_m) {
  const SimTK::Mat33& R = X_ba.R().asMat33();  // R(i, j): axis j of a along axis i of b
  const Vec3 half_a = 0.5 * (a.high - a.low) + Vec3(margin_m), half_b = 0.5 * (b.high - b.low);
  const Vec3 t = X_ba * (0.5 * (a.low + a.high)) - 0.5 * (b.low + b.high);
  constexpr double kParallel = 1e-12;
  double size[3][3];
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) size[i][j] = std::abs(R(i, j)) + kParallel;
    if (std::abs(t[i]) > half_b[i] + half_a[0] * size[i][0] + half_a[1] * size[i][1] + half_a[2] * size[i][2]) return false;
  }
  for (int j = 0; j < 3; ++j) {
    const double along = t[0] * R(0, j) + t[1] * R(1, j) + t[2] * R(2, j);
    if (std::abs(along) > half_a[j] + half_b[0] * size[0][j] + half_b[1] * size[1][j] + half_b[2] * size[2][j]) return false;
  }
  for (int i = 0; i < 3; ++i) {
    const int i1 = (i + 1) % 3, i2 = (i + 2) % 3;
    for (int j = 0; j < 3; ++j) {
      const int j1 = (j + 1) % 3, j2 = (j + 2) % 3;
      const double reach = half_b[i1] * size[i2][j] + half_b[i2] * size[i1][j] + half_a[j1] * size[i][j2] + half_a[j2] * size[i][j1];
      if (std::abs(t[i2] * R(i1, j) - t[i1] * R(i2, j)) > reach) return false;
    }
  }
  return true;
}

Mesh::Mesh(std::vector<Vec3> vertices, std::vector<Face> faces) : vertices_(std::move(vertices)), faces_(std::move(faces)) {
  normals_.reserve(faces_.size());
  edges_.reserve(3 * faces_.size() / 2);
  for (const Face& f : faces_) {
    const Vec3 n = cross(vertices_[f[1]] - vertices_[f[0]], vertices_[f[2]] - vertices_[f[0]]);
    normals_.push_back(n / n.norm());
  }
  const std::vector<std::int32_t> opposite = find_opposite_edges(faces_, vertices_.size());
  for (std::int32_t e = 0; e < static_cast<std::int32_t>(opposite.size()); ++e) {
    if (opposite[e] > e) edges_.push_back({{faces_[e / 3][e % 3], faces_[e / 3][(e % 3 + 1) % 3]}, {e / 3, opposite[e] / 3}});
  }
  make_tree();
}

Vec3 Mesh::calc_centroid(int f) const { return (vertices_[faces_[f][0]] + vertices_[faces_[f][1]] + vertices_[faces_[f][2]]) / 3.0; }

void Mesh::make_tree() {
  struct Key {
    double at;
    int face;
    bool operator<(const Key& other) const { return at != other.at ? at < other.at : face < other.face; }
  };
  std::vector<Vec3> middles(faces_.size());
  std::vector<Box> boxes(faces_.size());
  std::vector<Key> keys(faces_.size());
  order_.resize(faces_.size());
  for (int f = 0; f < face_count(); ++f) {
    order_[f] = f;
    middles[f] = calc_centroid(f);
    for (const int v : faces_[f]) boxes[f].add(vertices_[v]);
  }
  nodes_.push_back({Box(), 0, face_count(), -1});
  for (std::size_t n = 0; n < nodes_.size(); ++n) {
    Node node = nodes_[n];
    for (int i = node.first; i < node.first + node.count; ++i) node.box.add(boxes[order_[i]]);
    if (node.count > kLeaf) {
      const Vec3 size = node.box.high - node.box.low;
      const int axis = size[0] >= size[1] && size[0] >= size[2] ? 0 : size[1] >= size[2] ? 1 : 2;
      const int half = node.count / 2;
      for (int i = 0; i < node.count; ++i) keys[i] = {middles[order_[node.first + i]][axis], order_[node.first + i]};
      std::nth_element(keys.begin(), keys.begin() + half, keys.begin() + node.count);
      for (int i = 0; i < node.count; ++i) order_[node.first + i] = keys[i].face;
      node.child = static_cast<int>(nodes_.size());
      nodes_.push_back({Box(), node.first, half, -1});
      nodes_.push_back({Box(), node.first + half, node.count - half, -1});
    }
    nodes_[n] = node;
  }
}

Vec3 Mesh::find_nearest_on_face(const Vec3& x, int f, Vec2& uv) const {
  const Vec3 &a = vertices_[faces_[f][0]], &b = vertices_[faces_[f][1]], &c = vertices_[faces_[f][2]];
  const Vec3 w = find_nearest_barycentric(x, a, b, c);
  uv = Vec2(w[0], w[1]);
  return w[0] * a + w[1] * b + w[2] * c;
}

Vec3 Mesh::find_nearest(const Vec3& x, bool& inside, int& face, Vec2& uv) const {
  double least = SimTK::Infinity, square = 0.0;  // squared distance; share of it along the normal of the face, squared
  Vec3 nearest(0);
  std::vector<std::pair<double, int>> open{{nodes_[0].box.calc_distance2(x), 0}};
  while (!open.empty()) {
    const auto [distance2, n] = open.back();
    open.pop_back();
    if (distance2 > least * (1.0 + kSame)) continue;
    const Node& node = nodes_[n];
    if (node.child >= 0) {
      std::pair<double, int> near{nodes_[node.child].box.calc_distance2(x), node.child};
      std::pair<double, int> far{nodes_[node.child + 1].box.calc_distance2(x), node.child + 1};
      if (far < near) std::swap(near, far);
      open.push_back(far);
      open.push_back(near);
      continue;
    }
    for (int i = 0; i < node.count; ++i) {
      const int f = order_[node.first + i];
      Vec2 at;
      const Vec3 place = find_nearest_on_face(x, f, at), d = x - place;
      const double d2 = d.normSqr();
      if (d2 > least * (1.0 + kSame)) continue;
      const double along = dot(d, normals_[f]), share = d2 > 0.0 ? along * along / d2 : 0.0;
      if (d2 >= least * (1.0 - kSame) && share <= square) continue;
      least = std::min(least, d2);
      square = share;
      nearest = place;
      face = f;
      uv = at;
      inside = along < 0.0;
    }
  }
  return nearest;
}

bool Mesh::find_crossing(const Vec3& origin, const Vec3& direction, double& distance, Vec3& normal) const {
  constexpr double kBeyond = 1e-12;  // of a triangle: a ray through an edge must not slip between two
  double least = SimTK::Infinity;
  const auto enter = [&](const Box& box) {
    double begin = 0.0, end = least;
    for (int k = 0; k < 3; ++k) {
      if (direction[k] == 0.0) {
        if (origin[k] < box.low[k] || origin[k] > box.high[k]) return false;
        continue;
      }
      const double p = (box.low[k] - origin[k]) / direction[k], q = (box.high[k] - origin[k]) / direction[k];
      begin = std::max(begin, std::min(p, q));
      end = std::min(end, std::max(p, q));
    }
    return begin <= end * (1.0 + 1e-12);
  };
  for_nodes(enter, [&](int f) {
    const Vec3& a = vertices_[faces_[f][0]];
    const Vec3 ab = vertices_[faces_[f][1]] - a, ac = vertices_[faces_[f][2]] - a;
    const Vec3 h = cross(direction, ac);
    const double det = dot(ab, h);
    if (std::abs(det) <= 1e-15 * ab.norm() * ac.norm()) return;
    const Vec3 s = origin - a;
    const double u = dot(s, h) / det;
    if (u < -kBeyond || u > 1.0 + kBeyond) return;
    const Vec3 q = cross(s, ab);
    const double v = dot(direction, q) / det;
    if (v < -kBeyond || u + v > 1.0 + kBeyond) return;
    const double t = dot(ac, q) / det;
    if (t < 0.0 || t >= least) return;
    least = t;
    normal = normals_[f];
  });
  if (!(least < SimTK::Infinity)) return false;
  distance = least;
  return true;
}

double Mesh::calc_lowest(const Box& box, const Vec3& up) {
  double lowest = 0.0;
  for (int k = 0; k < 3; ++k) lowest += std::min(up[k] * box.low[k], up[k] * box.high[k]);
  return lowest;
}

}  // namespace carillon::contact
