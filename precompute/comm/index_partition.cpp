#include "precompute/comm/index_partition.hpp"

#include <numeric>

namespace carillon::comm {

IndexPartition::IndexPartition(const Communicator& comm, std::int64_t own_count) : rank_(comm.rank()) {
  comm.agree([&] { begin_.assign(comm.size() + 1, 0); });
  MPI_Allgather(&own_count, 1, MPI_INT64_T, begin_.data() + 1, 1, MPI_INT64_T, comm);
  std::partial_sum(begin_.begin(), begin_.end(), begin_.begin());
}

IndexPartition IndexPartition::make_even(const Communicator& comm, std::int64_t total) {
  IndexPartition partition;
  partition.rank_ = comm.rank();
  const std::int64_t ranks = comm.size();
  for (std::int64_t r = 0; r <= ranks; ++r) partition.begin_.push_back(total / ranks * r + std::min(r, total % ranks));
  return partition;
}

}  // namespace carillon::comm
