// Rows of the ranks in an order that does not depend on the partition: that of the mesh's nodes.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "precompute/mesh/distributed/distributed_mesh.hpp"
#include "precompute/comm/exchange.hpp"
#include "precompute/la/block_kernels.hpp"

namespace carillon::io {

/// The free nodes of the mesh in the order of their numbers in it, cut into one stretch a rank. Columns over the rows of K go there and
/// back; no rank ever holds more than its share.
class NodeOrder {
 public:
  /// Collective.
  NodeOrder(const comm::Communicator& comm, const mesh::LocalMesh& local);

  std::int64_t first() const { return first_; }                                    // place of this rank's stretch,
  std::int64_t count() const { return static_cast<std::int64_t>(place_.size()); }  // how many nodes it has,
  std::int64_t all() const { return all_; }                                        // and all ranks'

  /// Buffers of this rank: what is sent, what comes in, and records (count(), 3, columns) of its stretch, node by node.
  struct Room {
    std::vector<double> sent, come, records;
  };
  /// For so many columns at a time. Local; what follows then takes no more memory.
  void make_room(int columns, Room& room);
  /// columns: where each begins, this rank's rows of K. Collective.
  void to_records(std::span<const double* const> columns, Room& room);
  void from_records(Room& room, const la::Columns& columns);

 private:
  std::vector<std::int32_t> row_;  // own free nodes as they are sent: by rank
  comm::Exchange exchange_;
  std::vector<std::int32_t> place_;  // of nodes as they come in, within this rank's stretch
  std::int64_t first_ = 0;
  std::int64_t all_ = 0;
};

}  // namespace carillon::io
