// Method: the bank's triangles are checked to be closed and oriented (two triangles an edge), split into components by shared edges, and
// the
//   components with positive signed volume (outer walls) become one mesh. Where several fans of triangles meet in one vertex, each fan gets
//   a vertex of its own. Curvature by a least-squares paraboloid.
// Source: textbook.
// Deviations: none.
#include "runtime/contact/surface.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <utility>

#include "runtime/config/error.hpp"

namespace carillon::contact {
namespace {

using SimTK::Vec3;

struct Selection {
  std::vector<Vec3> vertices;
  std::vector<Face> faces;
  std::vector<std::int32_t> bank_triangle;
};

/// The opposite of every half-edge. Checks that every edge has exactly two triangles that run along it in opposite directions.
std::vector<std::int32_t> find_checked_opposites(const Vertices& vertices, const Triangles& triangles, const std::string& body) {
  const auto count = static_cast<std::int32_t>(vertices.size());
  if (triangles.empty()) {
    throw InputError(fmt::format("body '{}': its bank has no surface triangles; make the bank again", body));
  }
  for (std::size_t v = 0; v < vertices.size(); ++v) {
    for (const double x : vertices[v]) {
      if (!std::isfinite(x))
        throw InputError(fmt::format("body '{}': surface vertex {} is not a finite point; make the bank again", body, v));
    }
  }
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    for (const std::int32_t v : triangles[t]) {
      if (v < 0 || v >= count) {
        throw InputError(fmt::format("body '{}': surface triangle {} names vertex {}, but there are {} vertices; make the bank again", body,
                                     t, v, count));
      }
    }
  }
  std::vector<std::int32_t> opposite = find_opposite_edges(triangles, vertices.size());
  const auto describe = [&](std::int32_t missing, const char* what) {
    const auto e = static_cast<std::size_t>(std::find(opposite.begin(), opposite.end(), missing) - opposite.begin());
    if (e == opposite.size()) return;
    throw InputError(fmt::format("body '{}': the surface is {} (triangle {}){} and make the bank again", body,
                                 fmt::format(fmt::runtime(missing == -1 ? "open at edge {}-{}" : "not a manifold at edge {}-{}"),
                                             triangles[e / 3][e % 3], triangles[e / 3][(e % 3 + 1) % 3]),
                                 e / 3, what));
  };
  describe(-2, ": more than two triangles meet there or two disagree about which side is outside; repair the mesh");
  describe(-1, "; close the mesh");
  return opposite;
}

/// Union-find: the smallest member of the group of each of `count` things, `joined` two and two.
std::vector<std::int32_t> find_groups(std::size_t count, const std::vector<std::pair<std::int32_t, std::int32_t>>& joined) {
  std::vector<std::int32_t> parent(count);
  std::iota(parent.begin(), parent.end(), 0);
  const auto root = [&](std::int32_t i) {
    while (parent[i] != i) i = parent[i] = parent[parent[i]];
    return i;
  };
  for (const auto& [first, second] : joined) {
    const auto a = root(first), b = root(second);
    parent[std::max(a, b)] = std::min(a, b);
  }
  for (std::size_t i = 0; i < count; ++i) parent[i] = root(static_cast<std::int32_t>(i));
  return parent;
}

/// The component of every triangle.
std::vector<std::int32_t> find_components(const std::vector<std::int32_t>& opposite) {
  std::vector<std::pair<std::int32_t, std::int32_t>> joined;
  joined.reserve(opposite.size() / 2);
  for (std::int32_t e = 0; e < static_cast<std::int32_t>(opposite.size()); ++e)
    if (e < opposite[e]) joined.emplace_back(e / 3, opposite[e] / 3);
  return find_groups(opposite.size() / 3, joined);
}

/// The fan of every corner of a triangle: corners of one vertex have the same number when edges at that vertex lead from one triangle to
/// the other.
std::vector<std::int32_t> find_fans(const std::vector<std::int32_t>& opposite) {
  std::vector<std::pair<std::int32_t, std::int32_t>> joined;
  joined.reserve(opposite.size());
  // The corner a half-edge begins at is where its opposite ends.
  for (std::int32_t e = 0; e < static_cast<std::int32_t>(opposite.size()); ++e)
    joined.emplace_back(e, opposite[e] / 3 * 3 + (opposite[e] % 3 + 1) % 3);
  return find_groups(opposite.size(), joined);
}

Vec3 corner(const Vertices& vertices, const Triangles& triangles, std::int32_t triangle, int k) {
  const auto& x = vertices[triangles[triangle][k]];
  return {x[0], x[1], x[2]};
}

Selection select_outer(const Vertices& vertices, const Triangles& triangles, const std::string& body) {
  const std::vector<std::int32_t> opposite = find_checked_opposites(vertices, triangles, body);
  const auto component = find_components(opposite);
  const auto fan = find_fans(opposite);
  Vec3 origin = corner(vertices, triangles, 0, 0);
  std::vector<double> volume(triangles.size(), 0.0);  // of a component: six times
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    const auto i = static_cast<std::int32_t>(t);
    const Vec3 a = corner(vertices, triangles, i, 0) - origin, b = corner(vertices, triangles, i, 1) - origin,
               c = corner(vertices, triangles, i, 2) - origin;
    volume[component[t]] += SimTK::dot(a, SimTK::cross(b, c));
    const Vec3 twice_area = SimTK::cross(b - a, c - a);
    if (!(twice_area.norm() > 1e-14 * (b - a).normSqr())) {
      throw InputError(fmt::format("body '{}': surface triangle {} has no area; repair the mesh and make the bank again", body, t));
    }
  }
  Selection s;
  std::vector<int> renumbered(fan.size(), -1);  // by fan, which is a vertex unless it is pinched
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    if (volume[component[t]] <= 0.0) continue;
    s.bank_triangle.push_back(static_cast<std::int32_t>(t));
    Face face{};
    for (int k = 0; k < 3; ++k) {
      int& index = renumbered[fan[3 * t + k]];
      if (index < 0) {
        index = static_cast<int>(s.vertices.size());
        s.vertices.push_back(corner(vertices, triangles, static_cast<std::int32_t>(t), k));
      }
      face[k] = index;
    }
    s.faces.push_back(face);
  }
  if (s.faces.empty()) {
    throw InputError(fmt::format(
        "body '{}': the surface is inside out (its signed volume is negative); turn the triangles and make the bank again", body));
  }
  return s;
}

Mesh make_mesh(const Vertices& vertices, const Triangles& triangles, const std::string& body, std::vector<std::int32_t>& bank_triangle) {
  Selection s = select_outer(vertices, triangles, body);
  bank_triangle = std::move(s.bank_triangle);
  return {std::move(s.vertices), std::move(s.faces)};
}

}  // namespace

Surface::Surface(const Vertices& vertices, const Triangles& triangles, const std::string& body)
    : mesh_(make_mesh(vertices, triangles, body, bank_triangle_)) {
  neighbours_.resize(mesh_.vertex_count());
  face_ridges_.resize(mesh_.face_count());
  face_middles_m_.reserve(mesh_.face_count());
  for (int f = 0; f < mesh_.face_count(); ++f) face_middles_m_.push_back(mesh_.calc_centroid(f));
  std::vector<int> valence(mesh_.vertex_count(), 0);
  for (const Mesh::Edge& edge : mesh_.edges())
    for (const int v : edge.vertices) ++valence[v];
  for (int v = 0; v < mesh_.vertex_count(); ++v) neighbours_[v].reserve(valence[v]);
  std::vector<double> lengths;
  lengths.reserve(mesh_.edges().size());
  for (const Mesh::Edge& edge : mesh_.edges()) {
    const int a = edge.vertices[0], b = edge.vertices[1];
    neighbours_[a].push_back(b);
    neighbours_[b].push_back(a);
    const Vec3 along = vertex(b) - vertex(a);
    lengths.push_back(along.norm());
    RidgeEdge ridge;
    ridge.vertices = edge.vertices;
    const auto find_into_face = [&](int k) -> Vec3 {
      Vec3 in = face_middles_m_[edge.faces[k]] - vertex(a);
      in -= along * (SimTK::dot(in, along) / along.normSqr());
      return in / in.norm();
    };
    ridge.into_face[1] = find_into_face(1);
    // A flat or hollow edge can never be the one that touches first.
    if (SimTK::dot(mesh_.normal(edge.faces[0]), ridge.into_face[1]) > -1e-3) continue;
    ridge.into_face[0] = find_into_face(0);
    for (const int f : edge.faces) {
      if (face_ridges_[f].empty()) face_ridges_[f].reserve(3);
      face_ridges_[f].push_back(static_cast<int>(ridges_.size()));
    }
    ridges_.push_back(ridge);
  }
  std::nth_element(lengths.begin(), lengths.begin() + lengths.size() / 2, lengths.end());
  edge_m_ = lengths[lengths.size() / 2];
  const Vec3 &low = mesh_.box().low, &high = mesh_.box().high;
  for (int f = 0; f < mesh_.face_count(); ++f) {
    double radius = 0.0;
    for (const int v : mesh_.face(f)) radius = std::max(radius, (vertex(v) - face_middles_m_[f]).norm());
    face_radii_m_.push_back(radius);
  }
  find_corners();
  middle_m_ = (low + high) / 2;
  size_m_ = (high - low).norm();
  thickness_m_ = SimTK::min(high - low);
}

void Surface::find_corners() {
  constexpr double kStraight = 2e-4;  // rad
  const int count = mesh_.vertex_count();
  is_corner_.assign(count, 0);
  std::vector<int> any_face(count, -1);
  for (int f = 0; f < mesh_.face_count(); ++f) {
    for (const int v : mesh_.face(f)) {
      if (is_corner_[v] != 0) continue;
      if (any_face[v] < 0) any_face[v] = f;
      const Vec3 bend = mesh_.normal(f) - mesh_.normal(any_face[v]);
      if (bend.norm() > kStraight) is_corner_[v] = 1;
    }
  }
  std::vector<Vec3> ways;  // to its neighbours, unit vectors
  for (int v = 0; v < count; ++v) {
    if (is_corner_[v] == 0) continue;
    ways.clear();
    for (const int w : neighbours_[v]) {
      const Vec3 way = vertex(w) - vertex(v);
      for (const Vec3& other : ways)  // the first test is quick
        if (SimTK::dot(way, other) < 0.0 && (way / way.norm() + other).norm() < kStraight) is_corner_[v] = 0;
      ways.push_back(way / way.norm());
    }
  }
}

double Surface::calc_curvature(const Vec3& point, const Vec3& normal) const {
  const double reach = std::max(2.5 * edge_m_, 0.04 * size_m_);
  double numerator = 0.0, denominator = 0.0;
  for (int v = 0; v < mesh_.vertex_count(); ++v) {
    const Vec3 d = vertex(v) - point;
    const double dist2 = d.normSqr();
    if (dist2 > reach * reach || dist2 == 0.0) continue;
    const double drop = -SimTK::dot(d, normal);
    const double half_r2 = 0.5 * std::max(dist2 - drop * drop, 1e-12 * dist2);
    numerator += drop * half_r2;
    denominator += half_r2 * half_r2;
  }
  return denominator > 0.0 ? numerator / denominator : 0.0;
}

}  // namespace carillon::contact
