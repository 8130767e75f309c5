// The body to solve: from a mesh file, or meshed from a shape or a surface, to its pieces on the ranks.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>

#include "precompute/fem/distribute.hpp"
#include "precompute/io/costs.hpp"
#include "precompute/io/meshing.hpp"
#include "precompute/io/run.hpp"
#include "precompute/io/surface_modes.hpp"
#include "precompute/mesh/check.hpp"

namespace carillon::io {

/// How the body is cut into elements.
struct Setting {
  job::Element element = job::Element::T10;
  double tolerance = 1e-8;            // of the solver
  std::optional<std::int64_t> nodes;  // of a body that is meshed here: so many, mid-side nodes among them,
  std::optional<double> edge_m;       // or edges so long; neither: the mesher's default
  int refinements = 0;                // of a mesh file: every tetrahedron into eight, so many times
};

/// The setting that a job gives itself, without "accuracy_cents".
Setting get_setting(const job::JobSpec& job);

struct Body {
  fem::Distribution pieces;
  mesh::CheckReport check;                           // rank 0
  std::int64_t held_nodes = 0;                       // rank 0
  Surface surface;                                   // rank 0
  std::map<std::int32_t, std::string> region_names;  // rank 0
  std::string source;                                // "bunny.msh", "bar with 2000 nodes"; for messages
  std::optional<BodyEstimate> estimate;              // of a surface that took too long to mesh: all but `source` is empty then
};

/// The key of the job that says in which unit its mesh is, and how, for messages about its size.
std::string describe_scale_key(const job::JobSpec& job);

/// What is known of the cost of solving it: of a body that was not read yet (pieces empty) by the job and the size of the file. Rank 0.
Extent find_extent(const Run& run, const Setting& setting, const Body& body);

/// Reads or makes the mesh, checks it, and gives each rank its piece; rank 0 forgets the mesh. Stations "read" and "partition".
/// Collective. Throws on every rank: InputError naming the file or the job's line, SystemError.
/// With `patience` (on one rank) a surface that is not meshed in time is estimated.
Body make_body(Run& run, const Setting& setting, Patience* patience = nullptr);

}  // namespace carillon::io
