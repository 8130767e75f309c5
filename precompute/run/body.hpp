// The body to solve: from a mesh file, or meshed from a shape or a surface, to its pieces on the ranks.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include "precompute/mesh/distributed/distributed_mesh.hpp"
#include "precompute/job/cost/problem_size.hpp"
#include "precompute/run/io/surface_modes.hpp"
#include "precompute/job/setting.hpp"
#include "precompute/mesh/check.hpp"
#include "precompute/run/meshing.hpp"
#include "precompute/run/run.hpp"

namespace carillon::ldlt {
class MeshOrder;
}  // namespace carillon::ldlt

namespace carillon::run {

using io::Surface;
using job::Setting;

struct Body {
  mesh::DistributedMesh pieces;
  std::shared_ptr<const ldlt::MeshOrder> order;      // of the factorisation (CutMesh); until the modes are sought
  mesh::CheckReport check;                           // rank 0
  std::vector<std::string> mesher_warnings;          // differences between mesh and surface; rank 0
  std::int64_t fixed_nodes = 0;                      // rank 0
  Surface surface;                                   // rank 0
  std::map<std::int32_t, std::string> region_names;  // rank 0
  std::string source;                                // "bunny.msh", "bar with 2000 nodes"; for messages
  std::optional<BodyEstimate> estimate;              // of a surface that took too long to mesh: all but `source` is empty then
};

/// The key of the job that says in which unit its mesh is, and how, for messages about its size.
std::string describe_scale_key(const job::JobSpec& job);

/// How many modes are computed for the job: more than `max_modes`, so that the lowest corrected ones are sure; none: all of the band.
std::optional<std::int64_t> find_computed_count(const job::JobSpec& job);

/// Size of the problem before the mesh is read or made: by the job and the size of the mesh file. Rank 0.
cost::ProblemSize estimate_size(const job::JobSpec& job, const Setting& setting);
/// The same of a body that was made. Rank 0.
cost::ProblemSize find_problem_size(const Run& run, const Setting& setting, const Body& body);

/// Reads or makes the mesh, checks it, and gives each rank its piece; rank 0 forgets the mesh. RunLog "read" and "partition".
/// Collective. Throws on every rank: InputError naming the file or the job's line, SystemError.
/// With `patience` (on one rank) a surface that is not meshed in time is estimated.
Body make_body(Run& run, const Setting& setting, Patience* patience = nullptr);

}  // namespace carillon::run
