// Reordering of distributed rows to mesh order, independent of the partition.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "precompute/comm/exchange.hpp"
#include "precompute/la/block_kernels.hpp"
#include "precompute/mesh/distributed/distributed_mesh.hpp"

namespace carillon::io {

/// The free nodes in mesh order, cut into one range per rank. Exchanges columns over the rows of K in both directions; no rank ever holds
/// more than its share.
class NodeOrder {
 public:
  /// Collective.
  NodeOrder(const comm::Communicator& comm, const mesh::LocalMesh& local);

  std::int64_t first() const { return first_; }                                    // first node of this rank's range,
  std::int64_t count() const { return static_cast<std::int64_t>(place_.size()); }  // its number of nodes,
  std::int64_t all() const { return all_; }                                        // number on all ranks

  /// Buffers of this rank: sent, received, and records (count(), 3, columns) of its range, node by node.
  struct Room {
    std::vector<double> sent, come, records;
  };
  /// Buffers for so many columns at a time. Local; later calls allocate nothing.
  void make_room(int columns, Room& room);
  /// columns: start of each, this rank's rows of K. Collective.
  void to_records(std::span<const double* const> columns, Room& room);
  void from_records(Room& room, const la::Columns& columns);

 private:
  std::vector<std::int32_t> row_;  // own free nodes in sending order: by rank
  comm::Exchange exchange_;
  std::vector<std::int32_t> place_;  // of received nodes, within this rank's range
  std::int64_t first_ = 0;
  std::int64_t all_ = 0;
};

}  // namespace carillon::io
