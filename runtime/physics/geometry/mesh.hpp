// Closed triangle mesh with neighbourhoods and a tree of boxes.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "runtime/physics/geometry/vectors.hpp"

namespace carillon::geometry {

/// Point of a mesh nearest to a given point.
struct Nearest {
  double distance2 = Box::kFar;
  int face = -1;   // -1: none within reach
  Vec3 weights{};  // barycentric; exactly 0 at edges and corners
  Vec3 place{};
};

/// Feature of a face at barycentric weights: its interior, one of its edges or one of its corners.
struct FaceFeature {
  int zeros = 0;       // number of zero weights; 1: on an edge, 2: at a corner
  int half_edge = -1;  // that edge, or the edge that leaves the corner
};
inline FaceFeature find_feature(int face, const Vec3& weights) {
  int zeros = 0, zero = 0, whole = 0;
  for (int k = 0; k < 3; ++k) {
    if (weights[k] <= 0.0)
      zero = k, ++zeros;
    else
      whole = k;
  }
  return {zeros, 3 * face + (zeros == 1 ? (zero + 1) % 3 : whole)};
}

/// Closed, oriented triangle mesh: every half-edge has exactly one opposite, every vertex one fan of triangles, normals point outwards.
/// Immutable.
class Mesh {
 public:
  /// Throws InputError if the surface is empty, open, non-manifold, degenerate or inside out. Vertices with several fans of triangles are
  /// split.
  Mesh(std::span<const Vec3> vertices_m, std::span<const std::array<std::int32_t, 3>> triangles);

  int count_faces() const { return static_cast<int>(faces.size()); }
  int count_vertices() const { return static_cast<int>(vertices.size()); }
  const Vec3& corner(int face, int k) const { return vertices[faces[face][k]]; }
  int vertex_of(int half_edge) const { return faces[half_edge / 3][half_edge % 3]; }
  static int next(int half_edge) { return half_edge % 3 == 2 ? half_edge - 2 : half_edge + 1; }
  Vec3 place(int face, const Vec3& w) const { return w[0] * corner(face, 0) + w[1] * corner(face, 1) + w[2] * corner(face, 2); }

  bool is_convex(int half_edge) const {
    const Vec3 along = vertices[vertex_of(next(half_edge))] - vertices[vertex_of(half_edge)];
    return dot(cross(normals[half_edge / 3], normals[opposite[half_edge] / 3]), along) > 0.0;
  }

  Nearest find_nearest_on_face(const Vec3& x, int face) const;
  /// Nearest point within a squared distance; `hint`: a face that may be near, or -1. With a `slack` the result may be further than the
  /// nearest point by up to `slack`, and is found sooner.
  Nearest find_nearest(const Vec3& x, double within2, int hint, double slack = 0.0) const;
  /// Nearest point by walking over neighbouring faces; if the start is near enough, it is the global nearest.
  Nearest walk_nearest(const Vec3& x, int face) const;
  /// True if x is inside, given its nearest point. Exact at edges and corners (pseudo-normals).
  bool is_inside(const Vec3& x, const Nearest& nearest) const;
  /// Calls take(face) for the faces whose box is within `reach` of x.
  template <class Take>
  void for_ball(const Vec3& x, double reach, Take&& take) const {
    std::array<int, 64> open{};
    std::size_t count = 0;
    open[count++] = 0;
    while (count > 0) {
      const Node& node = nodes_[open[--count]];
      if (node.box.calc_distance2(x) > reach * reach) continue;
      if (node.child >= 0) {
        open[count++] = node.child;
        open[count++] = node.child + 1;
      } else {
        for (int i = 0; i < node.count; ++i) take(order_[node.first + i]);
      }
    }
  }
  /// Calls take(face) for the faces whose box the line from x along d may cross.
  template <class Take>
  void for_ray(const Vec3& x, const Vec3& d, double length, Take&& take) const {
    std::array<int, 64> open{};
    std::size_t count = 0;
    open[count++] = 0;
    while (count > 0) {
      const Node& node = nodes_[open[--count]];
      if (!crosses(node.box, x, d, length)) continue;
      if (node.child >= 0) {
        open[count++] = node.child;
        open[count++] = node.child + 1;
      } else {
        for (int i = 0; i < node.count; ++i) take(order_[node.first + i]);
      }
    }
  }

  // Constant after construction.
  std::vector<Vec3> vertices, normals;  // normals: unit, of faces
  std::vector<std::array<std::int32_t, 3>> faces;
  std::vector<std::int32_t> opposite;       // half-edge 3 f + k runs from corner k to the next; its reverse half-edge
  std::vector<Vec3> vertex_normals;         // angle-weighted; not unit
  std::vector<std::int32_t> any_half_edge;  // that begins at the vertex
  Box box;
  double volume_m3 = 0.0, area_m2 = 0.0;

 private:
  struct Node {
    Box box;
    int first = 0, count = 0;
    int child = -1;
  };
  static bool crosses(const Box& box, const Vec3& x, const Vec3& d, double length);
  void make_tree();
  std::vector<Node> nodes_;
  std::vector<int> order_;
};

}  // namespace carillon::geometry
