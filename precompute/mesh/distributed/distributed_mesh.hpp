// A mesh distributed over ranks.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "precompute/comm/communicator.hpp"
#include "runtime/base/vector.hpp"

namespace carillon::mesh {

/// Part of the mesh on one rank: its tetrahedra, the nodes it owns, and the halo, the other nodes of its tetrahedra. A node touched by
/// several ranks is owned by one of them.
struct LocalMesh {
  int order = 1;                           // 1 or 2
  std::vector<std::int32_t> tets;          // (e, 4) or (e, 10), local node numbers
  std::vector<std::int32_t> tet_in_mesh;   // (e) number in the whole mesh
  std::vector<std::int32_t> region;        // (e) TetMesh::regions
  std::vector<Vec3> nodes_m;               // (n): owned free nodes by ascending row, owned fixed nodes, halo
  std::vector<Vec3> doubt_m;               // (n) TetMesh::doubt_m, or empty
  std::vector<std::int32_t> node_in_mesh;  // (n) number in the whole mesh
  std::vector<std::int32_t> row;           // (n) global number among the free nodes of all ranks; -1: fixed
  std::vector<std::int32_t> component;     // (n) connected component
  std::vector<std::int32_t> fixed_by;  // (n) index of the entry of the job's "fixed" that fixes the node, -1: free; empty: nothing is fixed
  std::int32_t free_nodes = 0;         // leading nodes that are owned and free; their rows are first_row, first_row + 1, ...
  std::int32_t owned_nodes = 0;        // leading nodes that are owned
  std::int32_t first_row = 0;
  bool is_surface_known = false;  // the run meshed the body: its facets are known. Not serialised

  int nodes_per_tet() const { return order == 1 ? 4 : 10; }
  /// Nodes of tetrahedron e, in local numbers.
  std::span<const std::int32_t> get_tet(std::int32_t e) const {
    const std::size_t width = nodes_per_tet();
    return {&tets[static_cast<std::size_t>(e) * width], width};
  }
  std::int32_t tet_count() const { return static_cast<std::int32_t>(tet_in_mesh.size()); }
};

/// Serialisation of a LocalMesh for messages.
std::vector<std::byte> serialise(const LocalMesh& local);
LocalMesh deserialise(const std::vector<std::byte>& bytes);

/// Quality of the distribution; the same on every rank.
struct PartitionReport {
  struct Rank {
    std::int64_t elements = 0;
    std::int64_t owned_nodes = 0;
    std::int64_t halo_nodes = 0;
  };
  std::vector<Rank> ranks;
  double element_balance = 1.0;  // largest / mean
  double node_balance = 1.0;     // owned nodes, largest / mean
  std::int64_t edge_cut = 0;     // pairs of tetrahedra that share a face across two ranks
  bool contiguous = true;        // the tetrahedra of every rank are connected through faces
};

struct DistributedMesh {
  LocalMesh local;
  PartitionReport report;
  std::int64_t nodes = 0;  // of the whole mesh, without unused nodes
  std::int64_t tets = 0;
  std::int64_t free_nodes = 0;  // of all ranks
  std::int32_t components = 0;  // connected through common nodes
  /// Per component up to three of its fixed nodes [m] that prevent the same rigid motions as all of them, the same on every rank; empty if
  /// no node is fixed.
  std::vector<std::vector<Vec3>> fixed_m;
  std::vector<std::int32_t> row_of_node;           // rank 0 only: (N) row of each node of the mesh, -1: fixed or unused
  std::vector<std::int32_t> elimination_position;  // rank 0 only: (free nodes), by row: nested dissection order of METIS, if requested
};

/// Fills the entries per rank and the balance of the report. Collective.
void report_ranks(const comm::Communicator& comm, DistributedMesh& mesh);

/// A fixed node and its component.
struct FixedPoint {
  Vec3 x_m;
  std::int32_t component;
};

/// Up to three of these points [m] that prevent the same rigid motions as all: the first, the one farthest from it, and the one farthest
/// from the line through both. Pure.
std::vector<Vec3> find_supporting_points(const std::vector<Vec3>& points_m);

/// Supporting points of each component (components); points in any order. Pure.
std::vector<std::vector<Vec3>> find_supporting_points(const std::vector<FixedPoint>& points, std::int32_t components);

/// The same as a flat list.
std::vector<FixedPoint> list_points(const std::vector<std::vector<Vec3>>& points_m);

/// Throws InputError, with text starting with `begin`, if no node is free or the rows of the matrices exceed 32 bits. Pure.
void check_free_nodes(std::int64_t free_nodes, const std::string& begin);

/// The report as a few lines of text.
std::string describe(const PartitionReport& report);

}  // namespace carillon::mesh
