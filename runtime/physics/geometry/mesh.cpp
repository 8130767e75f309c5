// Method: half-edges are paired and checked; vertices with several fans are split; the tree splits faces at the median centroid along the
// longest side of their box, down to four per leaf. Nearest points by branch and bound from a hint.
// Source: C. Ericson, "Real-Time Collision Detection" (2005), 5.1.5, 6.1; sign by angle-weighted pseudo-normals: J. A. Baerentzen,
//   H. Aanaes, "Signed distance computation using the angle weighted pseudonormal" (2005).
#include "runtime/physics/geometry/mesh.hpp"

#include <numeric>
#include <string>
#include <utility>

#include "runtime/bank/edges.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/triangle.hpp"

namespace carillon::geometry {
namespace {

constexpr int kLeaf = 4;
constexpr double kSame = 1e-13;  // relative: distances counted as equal

void check_input(std::span<const Vec3> vertices, std::span<const Triangle> triangles) {
  if (triangles.empty()) throw InputError("its bank has no surface triangles; make the bank again");
  for (std::size_t v = 0; v < vertices.size(); ++v) {
    for (const double x : vertices[v])
      if (!std::isfinite(x)) throw InputError("surface vertex " + std::to_string(v) + " is not a finite point; make the bank again");
  }
  const auto count = static_cast<std::int32_t>(vertices.size());
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    for (const std::int32_t v : triangles[t]) {
      if (v < 0 || v >= count) {
        throw InputError("surface triangle " + std::to_string(t) + " names vertex " + std::to_string(v) + ", but there are " +
                         std::to_string(count) + " vertices; make the bank again");
      }
    }
  }
}

std::vector<std::int32_t> find_opposites(const std::vector<Triangle>& triangles, std::size_t vertices) {
  std::vector<std::int32_t> opposite(3 * triangles.size(), -1);
  bank::for_each_edge(triangles, vertices, [&](std::int32_t low, const bank::HalfEdge* first, const bank::HalfEdge* last) {
    const auto begins_low = [&](const bank::HalfEdge& e) { return triangles[e.number / 3][e.number % 3] == low; };
    const bool is_edge = low != first->upper;
    if (last - first == 1 && is_edge) return;
    if (last - first == 2 && is_edge && begins_low(first[0]) != begins_low(first[1])) {
      opposite[first[0].number] = first[1].number;
      opposite[first[1].number] = first[0].number;
      return;
    }
    for (const bank::HalfEdge* e = first; e < last; ++e) opposite[e->number] = -2;
  });
  const auto describe = [&](std::int32_t missing, const std::string& what, const char* advice) {
    const auto found = std::find(opposite.begin(), opposite.end(), missing);
    if (found == opposite.end()) return;
    const auto e = found - opposite.begin();
    throw InputError("the surface is " + what + " at edge " + std::to_string(triangles[e / 3][e % 3]) + "-" +
                     std::to_string(triangles[e / 3][(e % 3 + 1) % 3]) + " (triangle " + std::to_string(e / 3) + ")" + advice);
  };
  describe(-2, "not a manifold",
           ": more than two triangles meet there or two disagree about which side is outside; repair the mesh and make the bank again");
  describe(-1, "open", "; close the mesh and make the bank again");
  return opposite;
}

}  // namespace

Mesh::Mesh(std::span<const Vec3> given_vertices, std::span<const Triangle> triangles) {
  check_input(given_vertices, triangles);
  faces.assign(triangles.begin(), triangles.end());
  opposite = find_opposites(faces, given_vertices.size());
  // One vertex per fan of faces.
  std::vector<std::int32_t> fan(3 * faces.size(), -1);
  std::vector<std::array<std::int32_t, 3>> renumbered(faces.size());
  for (std::size_t start = 0; start < fan.size(); ++start) {
    if (fan[start] >= 0) continue;
    const auto v = static_cast<std::int32_t>(vertices.size());
    vertices.push_back(given_vertices[faces[start / 3][start % 3]]);
    any_half_edge.push_back(static_cast<std::int32_t>(start));
    for (std::size_t e = start; fan[e] < 0;) {
      fan[e] = v;
      renumbered[e / 3][e % 3] = v;
      e = next(opposite[e]);  // next half-edge about the vertex, clockwise
    }
  }
  faces = std::move(renumbered);

  vertex_normals.assign(vertices.size(), Vec3{});
  normals.reserve(faces.size());
  for (const Vec3& x : vertices) box.add(x);
  const Vec3 origin = corner(0, 0);
  for (int f = 0; f < count_faces(); ++f) {
    const Vec3 a = corner(f, 0), b = corner(f, 1), c = corner(f, 2);
    const Vec3 n = cross(b - a, c - a);
    const double twice = norm(n);
    if (!(twice > 1e-14 * norm2(b - a))) {
      throw InputError("surface triangle " + std::to_string(f) + " has no area; repair the mesh and make the bank again");
    }
    normals.push_back((1.0 / twice) * n);
    volume_m3 += dot(a - origin, cross(b - origin, c - origin)) / 6.0;
    area_m2 += 0.5 * twice;
    for (int k = 0; k < 3; ++k) {
      const Vec3 p = corner(f, (k + 1) % 3) - corner(f, k), q = corner(f, (k + 2) % 3) - corner(f, k);
      Vec3& sum = vertex_normals[vertex_of(3 * f + k)];
      sum = sum + std::atan2(norm(cross(p, q)), dot(p, q)) * normals.back();
    }
  }
  if (!(volume_m3 > 0.0)) {
    throw InputError("the surface is inside out (its signed volume is negative); turn the triangles and make the bank again");
  }
  make_tree();
}

void Mesh::make_tree() {
  using Key = std::pair<double, int>;
  std::vector<Box> boxes(faces.size());
  std::vector<Vec3> middles(faces.size());
  std::vector<Key> keys(faces.size());
  order_.resize(faces.size());
  std::iota(order_.begin(), order_.end(), 0);
  for (std::size_t f = 0; f < faces.size(); ++f) {
    for (int k = 0; k < 3; ++k) boxes[f].add(corner(static_cast<int>(f), k));
    middles[f] = 0.5 * (boxes[f].low + boxes[f].high);
  }
  nodes_.push_back({Box(), 0, count_faces(), -1});
  for (std::size_t n = 0; n < nodes_.size(); ++n) {
    Node node = nodes_[n];
    for (int i = node.first; i < node.first + node.count; ++i) node.box.add(boxes[order_[i]]);
    if (node.count > kLeaf) {
      const Vec3 side = node.box.high - node.box.low;
      const std::size_t axis = side[0] >= side[1] && side[0] >= side[2] ? 0 : side[1] >= side[2] ? 1 : 2;
      const int half = node.count / 2;
      for (int i = 0; i < node.count; ++i) {
        const int f = order_[node.first + i];
        keys[i] = {middles[f][axis], f};
      }
      std::nth_element(keys.begin(), keys.begin() + half, keys.begin() + node.count);
      for (int i = 0; i < node.count; ++i) order_[node.first + i] = keys[i].second;
      node.child = static_cast<int>(nodes_.size());
      nodes_.push_back({Box(), node.first, half, -1});
      nodes_.push_back({Box(), node.first + half, node.count - half, -1});
    }
    nodes_[n] = node;
  }
}

Nearest Mesh::find_nearest_on_face(const Vec3& x, int face) const {
  const Vec3 &a = corner(face, 0), &b = corner(face, 1), &c = corner(face, 2);
  const Vec3 ab = b - a, ac = c - a, ax = x - a, bx = x - b, cx = x - c;
  Nearest found;
  found.face = face;
  found.weights = weigh_corners(dot(ab, ax), dot(ac, ax), dot(ab, bx), dot(ac, bx), dot(ab, cx), dot(ac, cx));
  found.place = found.weights[0] * a + found.weights[1] * b + found.weights[2] * c;
  found.distance2 = norm2(x - found.place);
  return found;
}

Nearest Mesh::find_nearest(const Vec3& x, double within2, int hint, double slack) const {
  Nearest best;
  best.distance2 = within2;
  if (hint >= 0) {
    const Nearest on = walk_nearest(x, hint);
    if (on.distance2 <= within2) best = on;
  }
  double bound2 = best.distance2;
  const auto tighten = [&] {
    bound2 = best.distance2;
    if (slack > 0.0) {
      const double bound = std::max(0.0, std::sqrt(bound2) - slack);
      bound2 = bound * bound;
    }
  };
  tighten();
  std::array<std::pair<double, int>, 64> open;
  std::size_t count = 0;
  open[count++] = {nodes_[0].box.calc_distance2(x), 0};
  while (count > 0) {
    const auto [distance2, n] = open[--count];
    if (distance2 > bound2 * (1.0 - kSame)) continue;
    const Node& node = nodes_[n];
    if (node.child >= 0) {
      std::pair<double, int> near{nodes_[node.child].box.calc_distance2(x), node.child};
      std::pair<double, int> far{nodes_[node.child + 1].box.calc_distance2(x), node.child + 1};
      if (far < near) std::swap(near, far);
      if (far.first < bound2) open[count++] = far;
      if (near.first < bound2) open[count++] = near;
      continue;
    }
    for (int i = 0; i < node.count; ++i) {
      const Nearest on = find_nearest_on_face(x, order_[node.first + i]);
      if (on.distance2 >= best.distance2) continue;
      best = on;
      tighten();
    }
  }
  return best;
}

Nearest Mesh::walk_nearest(const Vec3& x, int face) const {
  constexpr int kMax = 100;
  Nearest best = find_nearest_on_face(x, face);
  for (int step = 0; step < kMax; ++step) {
    const auto [zeros, start] = find_feature(best.face, best.weights);
    if (zeros == 0) break;
    Nearest better = best;
    const Vec3 out = x - best.place;
    const auto try_face = [&](int f) {
      const Nearest beyond = find_nearest_on_face(x, f);
      if (beyond.distance2 < better.distance2) better = beyond;
    };
    // A neighbouring face can only be nearer if the angle at its corner to the direction of x is below a right angle.
    const auto leads = [&](int half_edge) { return dot(out, vertices[vertex_of(half_edge)] - best.place) > 0.0; };
    if (zeros == 1) {
      const int e = opposite[start];
      if (leads(next(next(e)))) try_face(e / 3);
    } else {
      bool before = leads(next(start));  // at the end of the last edge
      for (int e = next(opposite[start]); e != start; e = next(opposite[e])) {
        const bool now = leads(next(e));
        if (before || now) try_face(e / 3);
        before = now;
      }
    }
    if (!(better.distance2 < best.distance2 * (1.0 - 1e-12))) break;
    best = better;
  }
  return best;
}

bool Mesh::is_inside(const Vec3& x, const Nearest& nearest) const {
  const Vec3 d = x - nearest.place;
  const auto [zeros, half_edge] = find_feature(nearest.face, nearest.weights);
  const Vec3& own = normals[nearest.face];
  if (zeros == 0) return dot(d, own) < 0.0;
  if (zeros == 1) return dot(d, own + normals[opposite[half_edge] / 3]) < 0.0;
  return dot(d, vertex_normals[vertex_of(half_edge)]) < 0.0;
}

bool Mesh::crosses(const Box& box, const Vec3& x, const Vec3& d, double length) {
  double begin = 0.0, end = length;
  for (std::size_t k = 0; k < 3; ++k) {
    if (d[k] == 0.0) {
      if (x[k] < box.low[k] || x[k] > box.high[k]) return false;
      continue;
    }
    const double p = (box.low[k] - x[k]) / d[k], q = (box.high[k] - x[k]) / d[k];
    begin = std::max(begin, std::min(p, q));
    end = std::min(end, std::max(p, q));
  }
  return begin <= end * (1.0 + 1e-12);
}

}  // namespace carillon::geometry
