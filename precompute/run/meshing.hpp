// Meshes of bodies without a mesh file: parametric shapes, and surfaces by carillon-mesh.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "precompute/job/job_spec.hpp"
#include "precompute/mesh/tet_mesh.hpp"
#include "runtime/base/triangle.hpp"
#include "runtime/base/vector.hpp"

namespace carillon::run {

/// Target size of a mesh: at most one of them; none: the mesher's default.
struct Fineness {
  std::optional<std::int64_t> nodes;  // mid-side nodes included
  std::optional<double> edge_m;
  int layers = 1;         // of a known shape, at least
  bool extrudes = false;  // a surface, whatever its method
};

/// The mesher's messages on a mesh.
struct MesherWords {
  std::vector<std::string> warnings;  // differences between mesh and file: repairs, closed holes, wrapping, rounding
  std::vector<std::string> remarks;
};

/// Meshes the body with tetrahedra of four (order 1) or ten nodes (order 2), mid-side nodes on the true surface. A surface is meshed by the
/// program carillon-mesh next to this one, started without a shell, in a temporary folder that is removed afterwards. Appends the mesher's
/// messages to `words`. An open surface without "wall_m" is refused, unless the body has "close_holes". Not collective. Throws InputError
/// naming the job's line if the body cannot be meshed, SystemError if carillon-mesh does not start or dies.
mesh::TetMesh make_body_mesh(const job::Body& body, int order, const Fineness& fineness, MesherWords& words);

/// Closed surface coarsened to about `nodes` nodes with the same volume, by carillon-mesh. Not collective. Throws as make_body_mesh().
std::pair<std::vector<Vec3>, std::vector<Triangle>> coarsen_surface(const std::vector<Vec3>& nodes_m,
                                                                    const std::vector<Triangle>& triangles, std::size_t nodes);

/// "bar, 20000 nodes" or "bunny.obj, edges of 0.002 m", for people.
std::string describe(const job::Body& body, const Fineness& fineness);

}  // namespace carillon::run
