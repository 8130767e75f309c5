// Messages of any length between this rank and others. Inner header of carillon::comm.
#pragma once

#include <mpi.h>

#include <algorithm>
#include <cstddef>
#include <vector>

namespace carillon::comm {

/// MPI counts in int: longer messages go in blocks of so many bytes.
inline constexpr std::size_t kBlockBytes = std::size_t{1} << 30;

/// Calls visit(first byte, bytes) for every block of `bytes`.
template <typename Visit>
void for_blocks(std::size_t bytes, std::size_t block_bytes, const Visit& visit) {
  for (std::size_t at = 0; at < bytes; at += block_bytes) visit(at, static_cast<int>(std::min(block_bytes, bytes - at)));
}

/// Messages under way. Both sides of a message cut it into the same blocks; empty messages are not sent at all.
class Messages {
 public:
  explicit Messages(std::size_t block_bytes = kBlockBytes) : block_bytes_(block_bytes) {}

  /// Makes room for `messages` of `bytes` in all, so that what follows does not allocate.
  void reserve(std::size_t messages, std::size_t bytes) { requests_.reserve(messages + bytes / block_bytes_); }
  void receive(MPI_Comm comm, void* to, std::size_t bytes, int from, int tag);
  void send(MPI_Comm comm, const void* from, std::size_t bytes, int to, int tag);
  /// Until all have arrived and all buffers may be used again.
  void wait();

 private:
  std::size_t block_bytes_;
  std::vector<MPI_Request> requests_;
};

}  // namespace carillon::comm
