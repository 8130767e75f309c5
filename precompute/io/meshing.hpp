// Meshes that a job asks for without a mesh file: parametric shapes, and surfaces by way of carillon-mesh.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "jobs/spec/job_spec.hpp"
#include "precompute/mesh/tet_mesh.hpp"

namespace carillon::io {

/// How fine: at most one of them; neither means the mesher's default.
struct Fineness {
  std::optional<std::int64_t> nodes;  // of the mesh, mid-side nodes among them
  std::optional<double> edge_m;
};

/// Meshes the body with tetrahedra of four (order 1) or ten nodes (order 2), the mid-side ones on the true surface. A surface is meshed by
/// the program carillon-mesh beside this one, started without a shell, in a temporary folder that is gone afterwards.
/// Not collective. Throws InputError naming the job's line for what cannot be meshed, SystemError when carillon-mesh does not start or
/// dies.
mesh::TetMesh make_body_mesh(const spec::Body& body, int order, const Fineness& fineness);

/// "bar, 20000 nodes" or "bunny.obj, edges of 0.002 m", for people.
std::string describe(const spec::Body& body, const Fineness& fineness);

}  // namespace carillon::io
