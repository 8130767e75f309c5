// Which material each tetrahedron is of.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "precompute/mesh/distributed/distributed_mesh.hpp"
#include "precompute/job/job_spec.hpp"

namespace carillon::fem {

/// The materials of a body; a single one for all of it converts to this.
struct Materials {
  Materials() = default;
  Materials(material::Material material) : list{std::move(material)} {}  // NOLINT(google-explicit-constructor)

  std::vector<material::Material> list;  // the same on every rank
  std::vector<std::string> region;       // of each in `list`: as the job names it, "" for the rest of the mesh; empty when there is one
  std::vector<std::int32_t> of_tet;      // (this rank's tetrahedra) place in `list`; empty: all 0

  std::int32_t find(std::int32_t tet) const { return of_tet.empty() ? 0 : of_tet[tet]; }
};

/// Finds the material of every tetrahedron from its region in the mesh. `region_names` (read on rank 0 only) are names of the mesh's
/// region tags; a job may use the tag or the name. Materials that no tetrahedron has are errors, so all of the list are used.
/// Collective. Throws InputError on every rank, naming the job's line and the regions there are: a region that the job names and the mesh
/// does not have; one that the job names twice, by tag and by name; one without material. SystemError on every rank when memory runs out on
/// one, or its tetrahedra lack region tags.
Materials find_materials(const comm::Communicator& comm, const mesh::LocalMesh& local, const job::JobSpec& job,
                         const std::map<std::int32_t, std::string>& region_names = {});

/// Volume of the tetrahedra of each material [m^3], the same on every rank. Collective.
std::vector<double> calc_volumes(const comm::Communicator& comm, const mesh::LocalMesh& local, const Materials& materials);

}  // namespace carillon::fem
