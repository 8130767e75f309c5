#include "precompute/comm/messages.hpp"

namespace carillon::comm {

void Messages::receive(MPI_Comm comm, void* to, std::size_t bytes, int from, int tag) {
  for_blocks(bytes, block_bytes_, [&](std::size_t at, int count) {
    MPI_Irecv(static_cast<char*>(to) + at, count, MPI_BYTE, from, tag, comm, &requests_.emplace_back());
  });
}

void Messages::send(MPI_Comm comm, const void* from, std::size_t bytes, int to, int tag) {
  for_blocks(bytes, block_bytes_, [&](std::size_t at, int count) {
    MPI_Isend(static_cast<const char*>(from) + at, count, MPI_BYTE, to, tag, comm, &requests_.emplace_back());
  });
}

void Messages::wait() {
  MPI_Waitall(static_cast<int>(requests_.size()), requests_.data(), MPI_STATUSES_IGNORE);
  requests_.clear();
}

}  // namespace carillon::comm
