// Points and edges of a body that may touch first, thinned to a number independent of the mesh.
#pragma once

#include <vector>

#include "runtime/physics/geometry/skin.hpp"

namespace carillon::geometry {

struct Sample {
  Vec3 point{};
  double reach_m = 0.0;  // maximum distance of the skin points that this sample represents
  VertexKind kind = VertexKind::smooth;
  int vertex = -1;  // mesh vertex; -1: within a face
  int face = -1;    // start of the skin search
  int first_neighbour = 0, neighbours = 0;
};

/// Convex sharp edge, or a straight piece of one.
struct Ridge {
  Vec3 begin{}, end{}, along{};  // along: unit
  std::array<Vec3, 2> into{};    // unit, in the plane of each side, perpendicular to the edge, into the face
  std::array<int, 2> faces{};
  std::array<int, 2> vertices{};
};

/// Ball that encloses the items [first, first + count) of an order.
struct Ball {
  Vec3 middle{};
  double radius_m = 0.0;
  int first = 0, count = 0;
  int child = -1;  // second child (the first is the next ball); -1: leaf
};

/// Calls act(i) for the items of those tree balls for which is_far is false.
template <typename IsFar, typename Act>
void for_near(const std::vector<Ball>& tree, IsFar&& is_far, Act&& act) {
  std::vector<int> open;
  if (!tree.empty()) open.push_back(0);
  while (!open.empty()) {
    const Ball& ball = tree[open.back()];
    open.pop_back();
    if (is_far(ball)) continue;
    if (ball.child >= 0) {
      open.push_back(ball.child + 1);
      open.push_back(ball.child);
      continue;
    }
    for (int i = ball.first; i < ball.first + ball.count; ++i) act(i);
  }
}

/// Immutable. Every corner of the mesh is a sample, convex sharp edges are covered by ridges, and every point of the curved skin lies
/// within `reach_m` of its sample.
class Samples {
 public:
  Samples(const Mesh& mesh, const Skin& skin);

  std::vector<Sample> samples;  // in tree order
  std::vector<int> neighbours;  // of smooth samples, flat list
  std::vector<Ridge> ridges;    // in tree order
  std::vector<int> vertices;    // mesh vertices in tree order, except those within flat facets and straight edges
  std::vector<Ball> sample_tree, ridge_tree, vertex_tree;
  double spacing_m = 0.0, reach_m = 0.0;  // reach_m: maximum over smooth samples
};

}  // namespace carillon::geometry
