// Assignment of materials to tetrahedra.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "precompute/job/job_spec.hpp"
#include "precompute/mesh/distributed/distributed_mesh.hpp"

namespace carillon::fem {

/// Materials of a body; converts from a single material.
struct Materials {
  Materials() = default;
  Materials(material::Material material) : list{std::move(material)} {}  // NOLINT(google-explicit-constructor)

  std::vector<material::Material> list;  // the same on every rank
  std::vector<std::string> region;       // of each in `list`: as named in the job, "" for the rest of the mesh; empty for a single one
  std::vector<std::int32_t> of_tet;      // (this rank's tetrahedra) index into `list`; empty: all 0

  std::int32_t find(std::int32_t tet) const { return of_tet.empty() ? 0 : of_tet[tet]; }
};

/// Finds the material of every tetrahedron from its mesh region. `region_names` (read on rank 0 only): names of the region tags; a job may
/// use tag or name. Unused materials are errors. Collective. Throws InputError on every rank, naming the job's line and the existing
/// regions: region of the job missing in the mesh; region named twice, by tag and by name; region without material. SystemError on every
/// rank when one is out of memory or lacks region tags.
Materials find_materials(const comm::Communicator& comm, const mesh::LocalMesh& local, const job::JobSpec& job,
                         const std::map<std::int32_t, std::string>& region_names = {});

/// Volume of the tetrahedra of each material [m^3], the same on every rank. Collective.
std::vector<double> calc_volumes(const comm::Communicator& comm, const mesh::LocalMesh& local, const Materials& materials);

}  // namespace carillon::fem
