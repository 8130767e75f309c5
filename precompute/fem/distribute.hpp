// From a mesh on rank 0 to pieces: each rank gets its own tetrahedra and the nodes they touch.
#pragma once

#include <mpi.h>

#include <cstdint>
#include <string>
#include <vector>

#include "precompute/mesh/tet_mesh.hpp"

namespace carillon::fem {

/// What one rank holds of the mesh: its own tetrahedra, the nodes it owns and the halo, which is the other nodes of its tetrahedra.
struct LocalMesh {
  int order = 1;                           // 1 or 2
  std::vector<std::int32_t> tets;          // (e, 4) or (e, 10), local node numbers
  std::vector<std::int32_t> tet_in_mesh;   // (e) number in the whole mesh
  std::vector<std::int32_t> region;        // (e) TetMesh::regions
  std::vector<Vec3> nodes_m;               // (n): owned free nodes by ascending row, owned held nodes, halo
  std::vector<Vec3> doubt_m;               // (n) TetMesh::doubt_m, or empty
  std::vector<std::int32_t> node_in_mesh;  // (n) number in the whole mesh
  std::vector<std::int32_t> row;           // (n) global number among the free nodes of all ranks; -1: held
  std::vector<std::int32_t> component;     // (n) connected component
  std::vector<std::int32_t> fixed_by;      // (n) which entry of the job's "fixed" fixes the node, -1: free; empty: nothing is fixed
  std::int32_t free_nodes = 0;             // the leading nodes that are owned and free; their rows are first_row, first_row + 1, ...
  std::int32_t owned_nodes = 0;            // the leading nodes that are owned
  std::int32_t first_row = 0;

  int nodes_per_tet() const { return order == 1 ? 4 : 10; }
  std::int32_t tet_count() const { return static_cast<std::int32_t>(tet_in_mesh.size()); }
};

/// How well the mesh was cut; the same on every rank.
struct PartitionReport {
  struct Rank {
    std::int64_t elements = 0;
    std::int64_t owned_nodes = 0;
    std::int64_t halo_nodes = 0;
  };
  std::vector<Rank> ranks;
  double element_balance = 1.0;  // largest / mean
  double node_balance = 1.0;     // owned nodes, largest / mean
  std::int64_t edge_cut = 0;     // pairs of tetrahedra that share a face and not a rank
  bool contiguous = true;        // every rank's tetrahedra are connected through faces
};

struct Distribution {
  LocalMesh local;
  PartitionReport report;
  std::int64_t nodes = 0;  // of the whole mesh, those that a tetrahedron uses
  std::int64_t tets = 0;
  std::int64_t free_nodes = 0;  // of all ranks
  std::int32_t components = 0;  // connected through common nodes
  /// Per component up to three of its held nodes [m] that stop the same rigid motions as all of them, the same on every rank; empty when no
  /// node is held at all.
  std::vector<std::vector<Vec3>> held_m;
  std::vector<std::int32_t> row_of_node;           // rank 0 only: (N) row of each node of the mesh, -1: held or unused
  std::vector<std::int32_t> elimination_position;  // rank 0 only: (free nodes), by row: METIS' nested dissection order, if wanted
};

struct DistributeOptions {
  bool elimination_order = false;  // order the whole graph on rank 0, for factorisations that cannot order a distributed matrix themselves
};

/// Cuts the mesh with METIS, numbers the free nodes so that each rank's are contiguous, and sends each rank its piece. The mesh and the
/// held nodes are read on rank 0 only; afterwards the mesh is not needed any more.
/// Collective. Throws on every rank: InputError when there are fewer tetrahedra than ranks, a held node is not in the mesh, or every node
/// is held; SystemError when memory runs out.
Distribution distribute(MPI_Comm comm, const mesh::TetMesh& mesh, const std::vector<std::int32_t>& held_nodes,
                        const DistributeOptions& options = {});

/// Of points [m], up to three that stop the same rigid motions as all of them: the first, the one farthest from it, and the one farthest
/// from the line through both. Pure.
std::vector<Vec3> pick_holding_points(const std::vector<Vec3>& points);

/// The report as a few lines of text for people.
std::string describe(const PartitionReport& report);

}  // namespace carillon::fem
