// Messages of any length. Internal header of carillon::comm.
#pragma once

#include <mpi.h>

#include <algorithm>
#include <cstddef>
#include <vector>

namespace carillon::comm {

/// MPI counts are int: longer messages are split into blocks of this size.
inline constexpr std::size_t kBlockBytes = std::size_t{1} << 30;

/// Calls visit(first byte, bytes) for every block of `bytes`.
template <typename Visit>
void for_blocks(std::size_t bytes, std::size_t block_bytes, const Visit& visit) {
  for (std::size_t at = 0; at < bytes; at += block_bytes) visit(at, static_cast<int>(std::min(block_bytes, bytes - at)));
}

/// Pending messages. Both sides split a message into the same blocks; empty messages are not sent.
class Messages {
 public:
  explicit Messages(std::size_t block_bytes = kBlockBytes) : block_bytes_(block_bytes) {}

  /// Reserves memory for `messages` of `bytes` in total, so that later calls do not allocate.
  void reserve(std::size_t messages, std::size_t bytes) { requests_.reserve(messages + bytes / block_bytes_); }
  void receive(MPI_Comm comm, void* to, std::size_t bytes, int from, int tag);
  void send(MPI_Comm comm, const void* from, std::size_t bytes, int to, int tag);
  /// Waits until all have completed and all buffers may be reused.
  void wait();

 private:
  std::size_t block_bytes_;
  std::vector<MPI_Request> requests_;
};

}  // namespace carillon::comm
