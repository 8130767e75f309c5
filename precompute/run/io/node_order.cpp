// Method: node numbers are cut into one range per rank; each rank sorts the nodes of its range and stores their senders. The same exchange
//   serves all columns.
#include "precompute/run/io/node_order.hpp"

#include <algorithm>
#include <numeric>

#include "precompute/comm/index_partition.hpp"

namespace carillon::io {
NodeOrder::NodeOrder(const comm::Communicator& comm, const mesh::LocalMesh& local) {
  const auto& numbers = local.node_in_mesh;
  std::int64_t max = 0;
  for (std::int32_t i = 0; i < local.free_nodes; ++i) max = std::max<std::int64_t>(max, numbers[i]);
  const std::int64_t stretch = comm.max(max) / comm.size() + 1;
  std::vector<std::int64_t> sent_begin;
  const auto own = comm.agree([&] {
    row_.resize(local.free_nodes);
    std::iota(row_.begin(), row_.end(), 0);
    const auto sorted =
        comm::sort_by_receiver(comm.size(), row_, [&](std::int32_t row) { return static_cast<int>(numbers[row] / stretch); });
    row_ = sorted.items;
    sent_begin = sorted.begin;
    std::vector<std::int32_t> going;
    for (const std::int32_t row : row_) going.push_back(numbers[row]);
    return going;
  });
  exchange_ = comm::Exchange(comm, std::move(sent_begin));
  std::vector<std::int32_t> arrived;
  comm.agree([&] {
    exchange_.reserve(sizeof(std::int32_t));
    arrived.resize(exchange_.received_count());
  });
  exchange_.forward(own.data(), arrived.data());
  comm.agree([&] {
    std::vector<std::int32_t> order(arrived.size());
    std::iota(order.begin(), order.end(), 0);
    std::sort(order.begin(), order.end(), [&](std::int32_t a, std::int32_t b) { return arrived[a] < arrived[b]; });
    place_.resize(arrived.size());
    for (std::size_t i = 0; i < order.size(); ++i) place_[order[i]] = static_cast<std::int32_t>(i);
  });
  const comm::IndexPartition stretches(comm, count());
  first_ = stretches.own_begin();
  all_ = stretches.total();
}

void NodeOrder::make_room(int columns, Room& room) {
  const std::size_t width = 3 * columns;
  room.sent.reserve(std::max(row_.size(), place_.size()) * width);
  room.come.reserve(std::max(row_.size(), place_.size()) * width);
  room.records.reserve(place_.size() * width);
  exchange_.reserve(width * sizeof(double));
}

void NodeOrder::to_records(std::span<const double* const> columns, Room& room) {
  const std::size_t width = 3 * columns.size();
  room.sent.resize(row_.size() * width);
  room.come.resize(place_.size() * width);
  room.records.resize(place_.size() * width);
  double* to = room.sent.data();
  for (const std::int32_t row : row_) {
    for (int d = 0; d < 3; ++d)
      for (const double* column : columns) *to++ = column[3 * static_cast<std::ptrdiff_t>(row) + d];
  }
  exchange_.forward(room.sent.data(), room.come.data(), width);
  for (std::size_t i = 0; i < place_.size(); ++i)
    std::copy_n(room.come.data() + i * width, width, room.records.data() + static_cast<std::size_t>(place_[i]) * width);
}

void NodeOrder::from_records(Room& room, const la::Columns& columns) {
  const std::size_t width = 3 * columns.count;
  room.sent.resize(place_.size() * width);
  room.come.resize(row_.size() * width);
  for (std::size_t i = 0; i < place_.size(); ++i)
    std::copy_n(room.records.data() + static_cast<std::size_t>(place_[i]) * width, width, room.sent.data() + i * width);
  exchange_.backward(room.sent.data(), room.come.data(), width);
  const double* from = room.come.data();
  for (const std::int32_t row : row_) {
    for (int d = 0; d < 3; ++d)
      for (int j = 0; j < columns.count; ++j) columns.column(j)[3 * static_cast<std::ptrdiff_t>(row) + d] = *from++;
  }
}

}  // namespace carillon::io
