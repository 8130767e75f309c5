// Search for the edge length that gives the requested node count.
#pragma once

#include <cstdint>
#include <functional>
#include <stdexcept>
#include <string>

#include "precompute/mesh/tet_mesh.hpp"

namespace carillon::mesher {

inline constexpr double kCountTolerance = 0.10;  // documented tolerance

/// Approximate node count of a body: `factor` times a law of the edge length, plus `base`. Solids: volume and skin terms; fitted to balls,
/// cylinders, cubes and the solid bunny with at least two rows of elements (error below 5 %), and to plates with one. Walls (`is_wall`,
/// area of both skins): only skins until the wall leaves room between them; fitted to the hollow bunny with edges of a third to one of its
/// wall (error below 8 %).
struct CountModel {
  double volume_m3 = 0, area_m2 = 0, factor = 1, base = 0;
  bool is_wall = false;
  double calc_nodes(double edge_m) const;
  double find_edge(double nodes) const;
};

/// Nodes of the mesh, including mid-side nodes at order 2.
std::int64_t count_nodes(const mesh::TetMesh& linear, int order);

/// The count cannot be met; `fewest` is the smallest count of all meshes made.
struct CountError : std::runtime_error {
  CountError(const std::string& what, double fewest_nodes, double nearest_nodes)
      : std::runtime_error(what), fewest(fewest_nodes), nearest(nearest_nodes) {}
  double fewest, nearest;
};

struct CountSearch {
  double target = 0;          // nodes
  int order = 1;              // of the counted mesh
  double longest_m = 0;       // longest edge tried
  double tolerance = 0;       // largest relative error of a result
  double contented = 0;       // relative error at which the search ends
  bool is_uncertain = false;  // the first mesh is a trial with a fifth of the nodes
};

/// Makes meshes with make(edge), starting at `edge_m`, until one meets the count; a failure of make at long edges counts as too few nodes.
/// Returns the nearest mesh (also the last one made); `edge_m` is then its edge. Throws CountError if none is within the tolerance, and
/// make's exception if it never succeeds. `attempts` counts the meshes: at most about twenty, forty if small.
mesh::TetMesh search_edge(const CountSearch& search, CountModel model, double& edge_m, int& attempts,
                          const std::function<mesh::TetMesh(double edge_m)>& make);

}  // namespace carillon::mesher
