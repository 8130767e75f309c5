// Meshes that a job asks for without a mesh file: parametric shapes, and surfaces by way of carillon-mesh.
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "precompute/job/job_spec.hpp"
#include "precompute/mesh/tet_mesh.hpp"
#include "runtime/base/triangle.hpp"
#include "runtime/base/vector.hpp"

namespace carillon::run {

/// How fine: at most one of them; neither means the mesher's default.
struct Fineness {
  std::optional<std::int64_t> nodes;  // of the mesh, mid-side nodes among them
  std::optional<double> edge_m;
};

/// The mesher's report on a surface before it meshes.
struct BodyEstimate {
  double volume_m3 = 0;
  double area_m2 = 0;  // of all skins
  double thickness_m = 0;
  std::int64_t nodes = 0;
  bool is_rough = false;  // of the surface as it was read, before its repair
};

/// The mesher's messages on a mesh.
struct MesherWords {
  std::vector<std::string> warnings;  // differences between mesh and file: repairs, closed holes, wrapping, rounding
  std::vector<std::string> remarks;
};

/// How long a mesher may take, and what it found out before it ended.
struct Patience {
  double seconds = std::numeric_limits<double>::infinity();  // of the clock
  std::optional<BodyEstimate> estimate{};                    // set when they were too few: there is no mesh then
};

/// Meshes the body with tetrahedra of four (order 1) or ten nodes (order 2), the mid-side ones on the true surface. A surface is meshed by
/// the program carillon-mesh next to this one, started without a shell, in a temporary folder that is gone afterwards.
/// Not collective. Throws InputError naming the job's line for what cannot be meshed, SystemError when carillon-mesh does not start or
/// dies. With `patience`, a surface that is not meshed in time gives an empty mesh and patience->estimate; InputError when not even that
/// is known some seconds later. The mesher's messages, also on an unfinished mesh, are added to `words`.
/// An open surface without "wall_m" is refused, unless the body has "close_holes".
mesh::TetMesh make_body_mesh(const job::Body& body, int order, const Fineness& fineness, MesherWords& words, Patience* patience = nullptr);

/// A closed surface with about `nodes` nodes, its volume kept, by the program carillon-mesh. Not collective. Throws as make_body_mesh().
std::pair<std::vector<Vec3>, std::vector<Triangle>> coarsen_surface(const std::vector<Vec3>& nodes_m,
                                                                    const std::vector<Triangle>& triangles, std::size_t nodes);

/// "bar, 20000 nodes" or "bunny.obj, edges of 0.002 m", for people.
std::string describe(const job::Body& body, const Fineness& fineness);

}  // namespace carillon::run
