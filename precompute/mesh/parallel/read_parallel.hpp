// A mesh file read by all ranks at once, each its own block: for meshes that fit the memory of no single rank.
//
//   if (parallel_mesh::is_parallel_format(file)) parallel_mesh::ParallelMesh mesh = parallel_mesh::read_parallel(comm, file, {.order = 2});
//
// The format is VTKHDF 1.0 UnstructuredGrid in one piece, arrays contiguous and uncompressed (docs/howto/large-meshes.md). Regions and node
// sets are named as in VTU files. The bytes are untrusted: whatever the file holds, the answer is a mesh or one error on every rank.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "precompute/mesh/distributed/distributed_mesh.hpp"
#include "precompute/mesh/check.hpp"

namespace carillon::parallel_mesh {

/// Nodes to fix: those of a set, or those in a closed box {low, high}, as mesh::find_fixed_nodes finds them.
struct FixedNodes {
  std::optional<std::string> node_set = std::nullopt;
  std::optional<std::array<Vec3, 2>> box_m = std::nullopt;
  std::string place = "";  // begins messages about it: "job.json:7: key 'fixed'"
};

/// A second cut, which sees the pieces of the first. All members are set, and collective.
struct Recut {
  std::function<bool(std::int64_t nodes)> is_wanted;  // for a mesh of so many nodes
  /// The rank of each element of the first cut.
  std::function<std::vector<std::int32_t>(const mesh::LocalMesh& first)> find_ranks;
  /// Gets the row of each own free node of the first cut as the mesh is cut in the end, wherever the second was wanted.
  std::function<void(const std::vector<std::int32_t>& rows)> renumber;
};

struct ReadOptions {
  int order = 2;       // of the elements to compute with, whatever the file has
  double scale = 1.0;  // metres per unit of the file; boxes are in metres
  std::vector<FixedNodes> fixed = {};
  std::optional<Recut> recut = {};
};

/// The boundary of the whole mesh; filled on rank 0 only. The same for every number of ranks, and the same as mesh::extract_boundary's.
struct Boundary {
  std::vector<Vec3> vertices_m;                        // (V) in the order of the nodes
  std::vector<std::array<std::int32_t, 3>> triangles;  // (T, 3) of vertices, counter-clockwise from outside, in the order of the elements
  std::vector<std::int32_t> row;                       // (V) LocalMesh::row, -1: fixed
};

struct ParallelMesh {
  mesh::DistributedMesh mesh;  // row_of_node and elimination_position stay empty: no rank knows all nodes
  mesh::CheckReport check;          // the same on every rank. Nothing is welded or straightened; component_of_node stays empty, and
                                    // mean_ratio_1_percent is that of the worst rank
  std::int64_t fixed_nodes = 0;
  Boundary boundary;
};

/// True if the file begins as HDF5 does. Not collective.
bool is_parallel_format(const std::filesystem::path& file);

/// Reads, checks, cuts and numbers the mesh without any rank ever holding the whole. Elements are turned where they are inside out. The cut
/// is by recursive inertial bisection, and then by options.recut; nodes and elements keep the numbers that mesh::check_mesh and
/// mesh::to_quadratic would give them. Collective. Throws on every rank: InputError naming the file and the element for whatever
/// mesh::check_mesh refuses (cracks and folded curved elements, which it would repair, become a warning and are refused by the assembly),
/// for a damaged file, for options that cannot be met, and when there are fewer tetrahedra than ranks; SystemError when the disk or the
/// memory fails.
ParallelMesh read_parallel(const comm::Communicator& comm, const std::filesystem::path& file, const ReadOptions& options);

}  // namespace carillon::parallel_mesh
