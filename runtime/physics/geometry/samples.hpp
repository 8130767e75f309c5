// Points and edges of a body that may be the first to touch, thinned so that their number does not grow with the mesh.
#pragma once

#include <vector>

#include "runtime/physics/geometry/skin.hpp"

namespace carillon::geometry {

struct Sample {
  Vec3 point{};
  double reach_m = 0.0;  // no place of the skin that this sample stands for is further away
  VertexKind kind = VertexKind::smooth;
  int vertex = -1;  // of the mesh; -1: amid a face
  int face = -1;    // where the skin search begins
  int first_neighbour = 0, neighbours = 0;
};

/// A convex sharp edge, or a straight piece of one.
struct Ridge {
  Vec3 begin{}, end{}, along{};  // along: unit
  std::array<Vec3, 2> into{};    // unit, in the plane of each side, at right angles to the edge, into the face
  std::array<int, 2> faces{};
  std::array<int, 2> vertices{};
};

/// A ball that holds the things [first, first + count) of an order.
struct Ball {
  Vec3 middle{};
  double radius_m = 0.0;
  int first = 0, count = 0;
  int child = -1;  // the other is the next; -1: a leaf
};

/// Calls act(i) for the things in the balls of a tree that are not far.
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

/// Never changes once it is made. Every corner of the mesh is a sample, convex sharp edges are covered by ridges, and every place of the
/// curved skin lies within `reach_m` of its sample.
class Samples {
 public:
  Samples(const Mesh& mesh, const Skin& skin);

  std::vector<Sample> samples;  // in the order of their tree
  std::vector<int> neighbours;  // of samples that are smooth, flat list
  std::vector<Ridge> ridges;    // in the order of their tree
  std::vector<int> vertices;    // of the mesh, in the order of their tree: all but those amid flat facets and straight edges
  std::vector<Ball> sample_tree, ridge_tree, vertex_tree;
  double spacing_m = 0.0, reach_m = 0.0;  // reach_m: largest of smooth samples
};

}  // namespace carillon::geometry
