// The edge length at which a mesh has the node count that was asked for.
#pragma once

#include <cstdint>
#include <functional>
#include <stdexcept>
#include <string>

#include "precompute/mesh/tet_mesh.hpp"

namespace carillon::mesher {

inline constexpr double kCountTolerance = 0.10;  // promised

/// About how many nodes a body gets: `factor` times a law of the edge length, and `base`. Solids: volume and skin apart; fitted to balls,
/// cylinders, cubes and the solid bunny with two rows of elements and more, where it is right within 5 %, and to plates with one. Walls
/// (`is_wall`, area of both skins): the skins alone until the wall leaves room between them; fitted to the hollow bunny with edges of a
/// third to one of its wall, where it is right within 8 %.
struct CountModel {
  double volume_m3 = 0, area_m2 = 0, factor = 1, base = 0;
  bool is_wall = false;
  double calc_nodes(double edge_m) const;
  double find_edge(double nodes) const;
};

/// Nodes of the mesh, of order 2 with those at the middle of its edges.
std::int64_t count_nodes(const mesh::TetMesh& linear, int order);

/// The count cannot be met; `fewest` is the smallest count of all meshes made.
struct CountError : std::runtime_error {
  CountError(const std::string& what, double fewest_nodes, double nearest_nodes)
      : std::runtime_error(what), fewest(fewest_nodes), nearest(nearest_nodes) {}
  double fewest, nearest;
};

struct CountSearch {
  double target = 0;          // nodes
  int order = 1;              // of the mesh that is counted
  double longest_m = 0;       // no edge longer than this is tried
  double tolerance = 0;       // largest relative error of a result
  double contented = 0;       // relative error at which the search ends
  bool is_uncertain = false;  // the model is uncertain: the first mesh is a trial with a fifth of the nodes
};

/// Makes meshes with make(edge), from `edge_m` on, until one has the count; a failure of make at long edges counts as too few of them.
/// Returns the mesh nearest to it, `edge_m` is its edge then; the last mesh made is that one. Throws CountError if none is within the
/// tolerance, and what make throws if it never succeeds. `attempts` counts the meshes. At most about twenty meshes, of small ones forty.
mesh::TetMesh search_edge(const CountSearch& search, CountModel model, double& edge_m, int& attempts,
                          const std::function<mesh::TetMesh(double edge_m)>& make);

}  // namespace carillon::mesher
