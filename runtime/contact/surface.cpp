// Method: the bank's triangles are checked to be closed and oriented (two triangles an edge), split into components by shared edges, and
// the
//   components with positive signed volume (outer walls) become one Simbody TriangleMesh. Where several fans of triangles meet in one
//   vertex, each fan gets a vertex of its own, since Simbody knows one fan a vertex only. Curvature by a least-squares paraboloid.
// Source: M. Sherman, A. Seth, S. Delp, "Simbody: multibody dynamics for biomedical research" (2011), mesh contact geometry.
// Deviations: none.
#include "runtime/contact/surface.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numeric>
#include <utility>

#include "runtime/config/error.hpp"

namespace carillon::contact {
namespace {

using SimTK::Vec3;

struct Selection {
  SimTK::Array_<Vec3> vertices;
  SimTK::Array_<int> indices;
  std::vector<std::int32_t> bank_triangle;
};

using EdgeMap = std::map<std::pair<std::int32_t, std::int32_t>, std::int32_t>;  // directed edge to its triangle

/// Checks that every edge has exactly two triangles that run along it in opposite directions.
EdgeMap make_directed_edges(const Vertices& vertices, const Triangles& triangles, const std::string& body) {
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
  EdgeMap edges;
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    const auto& corners = triangles[t];
    for (int k = 0; k < 3; ++k) {
      if (corners[k] < 0 || corners[k] >= count) {
        throw InputError(fmt::format("body '{}': surface triangle {} names vertex {}, but there are {} vertices; make the bank again", body,
                                     t, corners[k], count));
      }
    }
    for (int k = 0; k < 3; ++k) {
      const auto edge = std::make_pair(corners[k], corners[(k + 1) % 3]);
      if (edge.first == edge.second || !edges.emplace(edge, static_cast<std::int32_t>(t)).second) {
        throw InputError(
            fmt::format("body '{}': the surface is not a manifold at edge {}-{} (triangle {}): more than two triangles meet there or two "
                        "disagree about "
                        "which side is outside; mend the mesh and make the bank again",
                        body, edge.first, edge.second, t));
      }
    }
  }
  for (const auto& [edge, triangle] : edges) {
    if (!edges.count({edge.second, edge.first})) {
      throw InputError(fmt::format("body '{}': the surface is open at edge {}-{} (triangle {}); close the mesh and make the bank again",
                                   body, edge.first, edge.second, triangle));
    }
  }
  return edges;
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
std::vector<std::int32_t> find_components(const Triangles& triangles, const EdgeMap& edges) {
  std::vector<std::pair<std::int32_t, std::int32_t>> joined;
  for (const auto& [edge, triangle] : edges) joined.emplace_back(triangle, edges.at({edge.second, edge.first}));
  return find_groups(triangles.size(), joined);
}

/// The fan of every corner of a triangle: corners of one vertex have the same number when edges at that vertex lead from one triangle to
/// the other.
std::vector<std::int32_t> find_fans(const Triangles& triangles, const EdgeMap& edges) {
  const auto corner_at = [&](std::int32_t t, std::int32_t vertex) {
    return 3 * t + static_cast<std::int32_t>(std::find(triangles[t].begin(), triangles[t].end(), vertex) - triangles[t].begin());
  };
  std::vector<std::pair<std::int32_t, std::int32_t>> joined;
  for (const auto& [edge, t] : edges) {
    const std::int32_t other = edges.at({edge.second, edge.first});
    joined.emplace_back(corner_at(t, edge.first), corner_at(other, edge.first));
  }
  return find_groups(3 * triangles.size(), joined);
}

Vec3 corner(const Vertices& vertices, const Triangles& triangles, std::int32_t triangle, int k) {
  const auto& x = vertices[triangles[triangle][k]];
  return {x[0], x[1], x[2]};
}

Selection select_outer(const Vertices& vertices, const Triangles& triangles, const std::string& body) {
  const EdgeMap edges = make_directed_edges(vertices, triangles, body);
  const auto component = find_components(triangles, edges);
  const auto fan = find_fans(triangles, edges);
  Vec3 origin = corner(vertices, triangles, 0, 0);
  std::map<std::int32_t, double> volume;  // six times
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    const auto i = static_cast<std::int32_t>(t);
    const Vec3 a = corner(vertices, triangles, i, 0) - origin, b = corner(vertices, triangles, i, 1) - origin,
               c = corner(vertices, triangles, i, 2) - origin;
    volume[component[t]] += SimTK::dot(a, SimTK::cross(b, c));
    const Vec3 twice_area = SimTK::cross(b - a, c - a);
    if (!(twice_area.norm() > 1e-14 * (b - a).normSqr())) {
      throw InputError(fmt::format("body '{}': surface triangle {} has no area; mend the mesh and make the bank again", body, t));
    }
  }
  Selection s;
  std::vector<int> renumbered(fan.size(), -1);  // by fan, which is a vertex unless it is pinched
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    if (volume[component[t]] <= 0.0) continue;
    s.bank_triangle.push_back(static_cast<std::int32_t>(t));
    for (int k = 0; k < 3; ++k) {
      int& index = renumbered[fan[3 * t + k]];
      if (index < 0) {
        index = static_cast<int>(s.vertices.size());
        s.vertices.push_back(corner(vertices, triangles, static_cast<std::int32_t>(t), k));
      }
      s.indices.push_back(index);
    }
  }
  if (s.indices.empty()) {
    throw InputError(fmt::format(
        "body '{}': the surface is inside out (its signed volume is negative); turn the triangles and make the bank again", body));
  }
  return s;
}

SimTK::ContactGeometry::TriangleMesh make_mesh(const Vertices& vertices, const Triangles& triangles, const std::string& body,
                                               std::vector<std::int32_t>& bank_triangle) {
  const Selection s = select_outer(vertices, triangles, body);
  bank_triangle = s.bank_triangle;
  try {
    return {s.vertices, s.indices, false};
  } catch (const SimTK::Exception::Base& e) {
    throw InputError(fmt::format("body '{}': Simbody refuses the surface as contact geometry ({}); mend the mesh", body, e.what()));
  }
}

}  // namespace

Surface::Surface(const Vertices& vertices, const Triangles& triangles, const std::string& body)
    : mesh_(make_mesh(vertices, triangles, body, bank_triangle_)) {
  neighbours_.resize(mesh_.getNumVertices());
  face_ridges_.resize(mesh_.getNumFaces());
  std::vector<double> lengths;
  for (int e = 0; e < mesh_.getNumEdges(); ++e) {
    const int a = mesh_.getEdgeVertex(e, 0), b = mesh_.getEdgeVertex(e, 1);
    neighbours_[a].push_back(b);
    neighbours_[b].push_back(a);
    const Vec3 along = vertex(b) - vertex(a);
    lengths.push_back(along.norm());
    RidgeEdge ridge;
    ridge.vertices = {a, b};
    for (int k = 0; k < 2; ++k) {
      const int f = mesh_.getEdgeFace(e, k);
      Vec3 in = mesh_.findCentroid(f) - vertex(a);
      in -= along * (SimTK::dot(in, along) / along.normSqr());
      ridge.into_face[k] = in / in.norm();
    }
    // A flat or hollow edge can never be the one that touches first.
    const Vec3 n0 = Vec3(mesh_.getFaceNormal(mesh_.getEdgeFace(e, 0)));
    if (SimTK::dot(n0, ridge.into_face[1]) > -1e-3) continue;
    for (int k = 0; k < 2; ++k) face_ridges_[mesh_.getEdgeFace(e, k)].push_back(static_cast<int>(ridges_.size()));
    ridges_.push_back(ridge);
  }
  std::nth_element(lengths.begin(), lengths.begin() + lengths.size() / 2, lengths.end());
  edge_m_ = lengths[lengths.size() / 2];
  Vec3 low(SimTK::Infinity), high(-SimTK::Infinity);
  for (int v = 0; v < mesh_.getNumVertices(); ++v) {
    for (int k = 0; k < 3; ++k) {
      low[k] = std::min(low[k], vertex(v)[k]);
      high[k] = std::max(high[k], vertex(v)[k]);
    }
  }
  for (int f = 0; f < mesh_.getNumFaces(); ++f) {
    face_middles_m_.push_back(mesh_.findCentroid(f));
    double radius = 0.0;
    for (int k = 0; k < 3; ++k) radius = std::max(radius, (vertex(mesh_.getFaceVertex(f, k)) - face_middles_m_[f]).norm());
    face_radii_m_.push_back(radius);
  }
  find_corners();
  middle_m_ = (low + high) / 2;
  size_m_ = (high - low).norm();
  thickness_m_ = SimTK::min(high - low);
}

void Surface::find_corners() {
  constexpr double kStraight = 2e-4;  // rad
  const int count = mesh_.getNumVertices();
  is_corner_.assign(count, 0);
  std::vector<int> any_face(count, -1);
  for (int f = 0; f < mesh_.getNumFaces(); ++f) {
    for (int k = 0; k < 3; ++k) {
      const int v = mesh_.getFaceVertex(f, k);
      if (any_face[v] < 0) any_face[v] = f;
      const Vec3 bend = Vec3(mesh_.getFaceNormal(f)) - Vec3(mesh_.getFaceNormal(any_face[v]));
      if (bend.norm() > kStraight) is_corner_[v] = 1;
    }
  }
  for (int v = 0; v < count; ++v) {
    const auto& around = neighbours_[v];
    for (std::size_t i = 0; i < around.size() && is_corner_[v] != 0; ++i) {
      const Vec3 to = vertex(around[i]) - vertex(v);
      for (std::size_t j = 0; j < i; ++j) {
        const Vec3 fro = vertex(around[j]) - vertex(v);
        if ((to / to.norm() + fro / fro.norm()).norm() < kStraight) is_corner_[v] = 0;
      }
    }
  }
}

double Surface::calc_curvature(const Vec3& point, const Vec3& normal) const {
  const double reach = std::max(2.5 * edge_m_, 0.04 * size_m_);
  double numerator = 0.0, denominator = 0.0;
  for (int v = 0; v < mesh_.getNumVertices(); ++v) {
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
