// A closed triangle mesh with a tree of boxes over its faces, for questions about places.
#pragma once

#include <SimTKcommon.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <utility>
#include <vector>

namespace carillon::contact {

using Face = std::array<int, 3>;

/// The half-edge 3 t + k of a triangle t runs from its corner k to the next. For each of them the one that runs back; -1 where there is
/// none, -2 where more than two triangles meet or two disagree about which side is outside. Corners must be indices below `vertices`.
std::vector<std::int32_t> find_opposite_edges(const std::vector<Face>& triangles, std::size_t vertices);

/// A box along the axes of its mesh.
struct Box {
  SimTK::Vec3 low{SimTK::Infinity}, high{-SimTK::Infinity};
  void add(const SimTK::Vec3& x) { add(Box{x, x}); }
  void add(const Box& other) {
    for (int k = 0; k < 3; ++k) {
      low[k] = std::min(low[k], other.low[k]);
      high[k] = std::max(high[k], other.high[k]);
    }
  }
  bool contains(const SimTK::Vec3& x) const;
  double calc_distance2(const SimTK::Vec3& x) const;
};

/// Do two boxes come within the margin of each other, X_ba taking the frame of `a` to that of `b`? True is a guess, false is sure.
bool are_boxes_near(const Box& a, const Box& b, const SimTK::Transform& X_ba, double margin_m);

class Mesh {
 public:
  /// An edge with its two faces; in the first of them it runs from vertices[0] to vertices[1].
  struct Edge {
    std::array<int, 2> vertices{}, faces{};
  };
  struct Node {
    Box box;
    int first = 0, count = 0;  // of order(): its faces
    int child = -1;            // the other is the next; -1: a leaf
  };

  /// Closed: every edge has two faces. No face is without area.
  Mesh(std::vector<SimTK::Vec3> vertices, std::vector<Face> faces);

  int vertex_count() const { return static_cast<int>(vertices_.size()); }
  int face_count() const { return static_cast<int>(faces_.size()); }
  const SimTK::Vec3& vertex(int v) const { return vertices_[v]; }
  const Face& face(int f) const { return faces_[f]; }
  const SimTK::Vec3& normal(int f) const { return normals_[f]; }  // unit, outward
  SimTK::Vec3 calc_centroid(int f) const;
  const std::vector<Edge>& edges() const { return edges_; }

  /// The tree: node 0 holds all.
  const Node& node(int n) const { return nodes_[n]; }
  const Box& box() const { return nodes_[0].box; }
  const std::vector<int>& order() const { return order_; }

  /// The place of a face nearest to x; its barycentric coordinates of the first two corners go to `uv`.
  SimTK::Vec3 find_nearest_on_face(const SimTK::Vec3& x, int f, SimTK::Vec2& uv) const;
  /// The place of the surface nearest to x, its face, and whether x is inside. At an edge that is nearest, the face that x lies most
  /// squarely before decides.
  SimTK::Vec3 find_nearest(const SimTK::Vec3& x, bool& inside, int& face, SimTK::Vec2& uv) const;
  /// The first place at which a ray (unit direction) goes through the surface, either way; false when it does not.
  bool find_crossing(const SimTK::Vec3& origin, const SimTK::Vec3& direction, double& distance, SimTK::Vec3& normal) const;
  /// Calls take(v) for the vertices x with up . x < height, for some of them more than once.
  template <class Take>
  void for_vertices_below(const SimTK::Vec3& up, double height, Take&& take) const {
    for_nodes([&](const Box& box) { return calc_lowest(box, up) < height; },
              [&](int f) {
                for (const int v : faces_[f])
                  if (SimTK::dot(up, vertices_[v]) < height) take(v);
              });
  }

 private:
  template <class Enter, class Take>
  void for_nodes(Enter&& enter, Take&& take) const {
    std::vector<int> open{0};
    while (!open.empty()) {
      const Node& node = nodes_[open.back()];
      open.pop_back();
      if (!enter(node.box)) continue;
      if (node.child >= 0) {
        open.push_back(node.child + 1);
        open.push_back(node.child);
      } else {
        for (int i = 0; i < node.count; ++i) take(order_[node.first + i]);
      }
    }
  }
  static double calc_lowest(const Box& box, const SimTK::Vec3& up);
  void make_tree();

  std::vector<SimTK::Vec3> vertices_, normals_;
  std::vector<Face> faces_;
  std::vector<Edge> edges_;
  std::vector<Node> nodes_;
  std::vector<int> order_;
};

}  // namespace carillon::contact
