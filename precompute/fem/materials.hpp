// Assignment of materials to tetrahedra.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "precompute/job/job_spec.hpp"
#include "precompute/mesh/distributed/distributed_mesh.hpp"
#include "precompute/mesh/tet_mesh.hpp"

namespace carillon::fem {

/// Materials of the mesh file, by region tag.
using FileMaterials = std::map<std::int32_t, mesh::FileMaterial>;

/// Materials of a body; converts from a single material.
struct Materials {
  Materials() = default;
  Materials(material::Material material) : list{std::move(material)} {}  // NOLINT(google-explicit-constructor)

  std::vector<material::Material> list;  // the same on every rank
  std::vector<std::string> region;       // of each in `list`: as named in the job, "" for the rest of the mesh; empty for a single one
  std::vector<std::int32_t> of_tet;      // (this rank's tetrahedra) index into `list`; empty: all 0
  std::vector<std::string> remarks;      // on materials of the mesh file

  std::int32_t find(std::int32_t tet) const { return of_tet.empty() ? 0 : of_tet[tet]; }
};

/// Finds the material of every tetrahedron from its mesh region. `region_names` and `file_materials` (read on rank 0 only): names of the
/// region tags, and the materials of "material": "file"; a job may use tag or name. Unused materials are errors. Collective. Throws
/// InputError on every rank, naming the job's line and the existing regions: region of the job missing in the mesh; region named twice, by
/// tag and by name; region without material. SystemError on every rank when one is out of memory or lacks region tags.
Materials find_materials(const comm::Communicator& comm, const mesh::LocalMesh& local, const job::JobSpec& job,
                         const std::map<std::int32_t, std::string>& region_names = {}, const FileMaterials& file_materials = {});

/// The solid of a mesh file. Without damping of its own it has that of the nearest solid of the table; `remark` says so. Throws InputError
/// if the file's material cannot be used.
material::Material make_material(const mesh::FileMaterial& material, std::string& remark);

/// Volume of the tetrahedra of each material [m^3], the same on every rank. Collective.
std::vector<double> calc_volumes(const comm::Communicator& comm, const mesh::LocalMesh& local, const Materials& materials);

}  // namespace carillon::fem
