// Parallel mesh reader: each rank reads its own block, for meshes that exceed the memory of one rank.
//
//   if (parallel_mesh::is_parallel_format(file)) parallel_mesh::ParallelMesh mesh = parallel_mesh::read_parallel(comm, file, {.order = 2});
//
// Format: VTKHDF 1.0 UnstructuredGrid in one piece, arrays contiguous and uncompressed (docs/howto/large-meshes.md). Regions and node sets
// are named as in VTU files. The bytes are untrusted: the result is a mesh, or one error on every rank.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "precompute/mesh/check.hpp"
#include "precompute/mesh/distributed/distributed_mesh.hpp"

namespace carillon::parallel_mesh {

/// Nodes to fix: a node set, or a closed box {low, high} as in mesh::find_fixed_nodes.
struct FixedNodes {
  std::optional<std::string> node_set = std::nullopt;
  std::optional<std::array<Vec3, 2>> box_m = std::nullopt;
  std::string place = "";  // prefix of its messages: "job.json:7: key 'fixed'"
};

/// Optional second partition, based on the parts of the first. All members are set, and collective.
struct Recut {
  std::function<bool(std::int64_t nodes)> is_wanted;  // for a mesh of this many nodes
  /// Rank of each element of the first partition.
  std::function<std::vector<std::int32_t>(const mesh::LocalMesh& first)> find_ranks;
  /// Receives the row, in the final partition, of each own free node of the first one, if the second was wanted.
  std::function<void(const std::vector<std::int32_t>& rows)> renumber;
};

struct ReadOptions {
  int order = 2;       // of the elements computed with, whatever the file contains
  double scale = 1.0;  // metres per unit of the file; boxes are in metres
  std::vector<FixedNodes> fixed = {};
  std::optional<Recut> recut = {};
};

/// Boundary of the whole mesh, on rank 0 only. Independent of the number of ranks; equal to that of mesh::extract_boundary.
struct Boundary {
  std::vector<Vec3> vertices_m;                        // (V) in node order
  std::vector<std::array<std::int32_t, 3>> triangles;  // (T, 3) of vertices, counter-clockwise from outside, in element order
  std::vector<std::int32_t> row;                       // (V) LocalMesh::row, -1: fixed
};

struct ParallelMesh {
  mesh::DistributedMesh mesh;  // row_of_node and elimination_position stay empty: no rank knows all nodes
  mesh::CheckReport check;     // the same on every rank. Nothing is welded or straightened; component_of_node stays empty, and
                               // mean_ratio_1_percent is that of the worst rank
  std::int64_t fixed_nodes = 0;
  Boundary boundary;
};

/// True if the file begins as HDF5 does. Not collective.
bool is_parallel_format(const std::filesystem::path& file);

/// Reads, checks, partitions and numbers the mesh without gathering it on any rank. Inverted elements are reoriented. Partition: recursive
/// inertial bisection, then options.recut; nodes and elements are numbered as by mesh::check_mesh and mesh::to_quadratic. Collective.
/// Throws on every rank: InputError with file and element for anything mesh::check_mesh refuses (cracks and folded curved elements, which
/// it would repair, give a warning and are refused by the assembly), for a damaged file, for options that cannot be met, and for fewer
/// tetrahedra than ranks; SystemError for disk or memory failures.
ParallelMesh read_parallel(const comm::Communicator& comm, const std::filesystem::path& file, const ReadOptions& options);

}  // namespace carillon::parallel_mesh
