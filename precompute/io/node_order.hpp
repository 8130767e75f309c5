// Rows of the ranks in an order that knows of no ranks: that of the mesh's nodes.
#pragma once

#include <mpi.h>

#include <cstdint>
#include <span>
#include <vector>

#include "precompute/eigen/block_kernels.hpp"
#include "precompute/fem/distribute.hpp"

namespace carillon::io {

/// The free nodes of the mesh in the order of their numbers in it, cut into one stretch a rank. Columns over the rows of K go there and
/// back; no rank ever holds more than its share.
class NodeOrder {
 public:
  /// Collective.
  NodeOrder(MPI_Comm comm, const fem::LocalMesh& local);

  std::int64_t first() const { return first_; }                                    // place of this rank's stretch,
  std::int64_t count() const { return static_cast<std::int64_t>(place_.size()); }  // how many nodes it has,
  std::int64_t all() const { return all_; }                                        // and all ranks'

  /// Buffers of this rank: what is sent, what comes in, and records (count(), 3, columns) of its stretch, node by node.
  struct Room {
    std::vector<double> sent, come, records;
  };
  /// For so many columns at a time. Local; what follows then takes no more memory.
  void make_room(int columns, Room& room) const;
  /// columns: where each begins, this rank's rows of K. Collective.
  void to_records(std::span<const double* const> columns, Room& room) const;
  void from_records(Room& room, const eigen::Columns& columns) const;

 private:
  MPI_Comm comm_;
  std::vector<std::int32_t> row_;                   // own free nodes as they are sent: by rank
  std::vector<int> sent_, sent_at_, got_, got_at_;  // nodes to and from each rank
  std::vector<std::int32_t> place_;                 // of nodes as they come in, within this rank's stretch
  std::int64_t first_ = 0;
  std::int64_t all_ = 0;
};

}  // namespace carillon::io
