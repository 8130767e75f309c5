// Method:     Numbers of nodes are cut into as many stretches as there are ranks; each rank sorts those that come into its own, and
//             remembers who sent which. The same ways serve all columns.
// Source:     none. Deviations: none.
#include "precompute/io/node_order.hpp"

#include <algorithm>
#include <numeric>

namespace carillon::io {
namespace {

std::vector<int> find_offsets(const std::vector<int>& counts) {
  std::vector<int> offsets(counts.size(), 0);
  std::partial_sum(counts.begin(), counts.end() - 1, offsets.begin() + 1);
  return offsets;
}

std::vector<int> scale(const std::vector<int>& counts, int factor) {
  std::vector<int> scaled = counts;
  for (int& count : scaled) count *= factor;
  return scaled;
}

}  // namespace

NodeOrder::NodeOrder(MPI_Comm comm, const fem::LocalMesh& local) : comm_(comm) {
  int ranks = 1;
  MPI_Comm_size(comm, &ranks);
  const auto& numbers = local.node_in_mesh;
  std::int64_t most = 0;
  for (std::int32_t i = 0; i < local.free_nodes; ++i) most = std::max<std::int64_t>(most, numbers[static_cast<std::size_t>(i)]);
  MPI_Allreduce(MPI_IN_PLACE, &most, 1, MPI_INT64_T, MPI_MAX, comm);
  const std::int64_t stretch = most / ranks + 1;
  row_.resize(static_cast<std::size_t>(local.free_nodes));
  std::iota(row_.begin(), row_.end(), 0);
  std::stable_sort(row_.begin(), row_.end(), [&](std::int32_t a, std::int32_t b) {
    return numbers[static_cast<std::size_t>(a)] / stretch < numbers[static_cast<std::size_t>(b)] / stretch;
  });
  sent_.assign(static_cast<std::size_t>(ranks), 0);
  got_ = sent_;
  std::vector<std::int32_t> going;
  for (const std::int32_t row : row_) {
    const std::int32_t number = numbers[static_cast<std::size_t>(row)];
    going.push_back(number);
    ++sent_[static_cast<std::size_t>(number / stretch)];
  }
  MPI_Alltoall(sent_.data(), 1, MPI_INT, got_.data(), 1, MPI_INT, comm);
  sent_at_ = find_offsets(sent_);
  got_at_ = find_offsets(got_);
  std::vector<std::int32_t> come(static_cast<std::size_t>(got_at_.back() + got_.back()));
  MPI_Alltoallv(going.data(), sent_.data(), sent_at_.data(), MPI_INT32_T, come.data(), got_.data(), got_at_.data(), MPI_INT32_T, comm);
  std::vector<std::int32_t> order(come.size());
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(),
            [&](std::int32_t a, std::int32_t b) { return come[static_cast<std::size_t>(a)] < come[static_cast<std::size_t>(b)]; });
  place_.resize(come.size());
  for (std::size_t i = 0; i < order.size(); ++i) place_[static_cast<std::size_t>(order[i])] = static_cast<std::int32_t>(i);
  const std::int64_t mine = count();
  std::int64_t until = 0;
  MPI_Scan(&mine, &until, 1, MPI_INT64_T, MPI_SUM, comm);
  first_ = until - mine;
  MPI_Allreduce(&mine, &all_, 1, MPI_INT64_T, MPI_SUM, comm);
}

void NodeOrder::make_room(int columns, Room& room) const {
  const std::size_t width = 3 * static_cast<std::size_t>(columns);
  room.sent.reserve(std::max(row_.size(), place_.size()) * width);
  room.come.reserve(std::max(row_.size(), place_.size()) * width);
  room.records.reserve(place_.size() * width);
}

void NodeOrder::to_records(std::span<const double* const> columns, Room& room) const {
  const auto width = static_cast<int>(3 * columns.size());
  const auto size = static_cast<std::size_t>(width);
  room.sent.resize(row_.size() * size);
  room.come.resize(place_.size() * size);
  room.records.resize(place_.size() * size);
  double* to = room.sent.data();
  for (const std::int32_t row : row_) {
    for (int d = 0; d < 3; ++d)
      for (const double* column : columns) *to++ = column[3 * static_cast<std::ptrdiff_t>(row) + d];
  }
  MPI_Alltoallv(room.sent.data(), scale(sent_, width).data(), scale(sent_at_, width).data(), MPI_DOUBLE, room.come.data(),
                scale(got_, width).data(), scale(got_at_, width).data(), MPI_DOUBLE, comm_);
  for (std::size_t i = 0; i < place_.size(); ++i)
    std::copy_n(room.come.data() + i * size, size, room.records.data() + static_cast<std::size_t>(place_[i]) * size);
}

void NodeOrder::from_records(Room& room, const eigen::Columns& columns) const {
  const int width = 3 * columns.count;
  const auto size = static_cast<std::size_t>(width);
  room.sent.resize(place_.size() * size);
  room.come.resize(row_.size() * size);
  for (std::size_t i = 0; i < place_.size(); ++i)
    std::copy_n(room.records.data() + static_cast<std::size_t>(place_[i]) * size, size, room.sent.data() + i * size);
  MPI_Alltoallv(room.sent.data(), scale(got_, width).data(), scale(got_at_, width).data(), MPI_DOUBLE, room.come.data(),
                scale(sent_, width).data(), scale(sent_at_, width).data(), MPI_DOUBLE, comm_);
  const double* from = room.come.data();
  for (const std::int32_t row : row_) {
    for (int d = 0; d < 3; ++d)
      for (int j = 0; j < columns.count; ++j) columns.column(j)[3 * static_cast<std::ptrdiff_t>(row) + d] = *from++;
  }
}

}  // namespace carillon::io
