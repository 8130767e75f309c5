// Asynchronous messages of doubles between ranks.
#pragma once

#include <mpi.h>

#include <cstdint>
#include <list>
#include <memory>
#include <optional>
#include <span>

#include "precompute/ldlt/buffer.hpp"

namespace carillon::ldlt {

/// Purpose of the numbers that follow.
struct Heading {
  std::int32_t kind = 0;
  std::int32_t front = 0;
  std::int32_t place = 0;  // of the sender
  std::int32_t index = 0;
};

/// A heading and its numbers, aligned for vector instructions.
class Letter {
 public:
  Letter() = default;
  /// Uninitialised numbers. Throws std::bad_alloc.
  Letter(const Heading& heading, std::int64_t count);
  explicit Letter(Buffer received) : data_(std::move(received)) {}

  Heading heading() const;
  double* numbers() const { return data_.data() + kHeadingNumbers; }
  std::int64_t count() const { return data_.size() - kHeadingNumbers; }
  const Buffer& data() const { return data_; }

 private:
  static constexpr std::int64_t kHeadingNumbers = 8;  // the numbers start on a cache line
  Buffer data_;
};

/// Sends letters and receives them in order of arrival; letters between two ranks stay in order. All ranks of a communicator use the same
/// tag exclusively.
class Mailbox {
 public:
  /// refuge: memory that receives a letter for which allocation failed; its contents are lost then. Must outlive this object.
  Mailbox(MPI_Comm comm, int tag, std::span<double> refuge) : comm_(comm), tag_(tag), refuge_(refuge) {}

  void send(int rank, Letter letter);
  /// The caller keeps shared, read-only access to the letter.
  void send(int rank, const std::shared_ptr<const Letter>& letter);
  /// A letter that has arrived, if any. Throws std::bad_alloc; the letter is lost then.
  std::optional<Letter> receive();
  /// Releases completed sends. True if none is pending.
  bool release();
  /// Yields the core to other processes after some unsuccessful polls. is_expecting: nothing but a letter can end the wait.
  void rest(bool is_expecting);

 private:
  struct Sent {
    std::shared_ptr<const Letter> letter;
    MPI_Request request = MPI_REQUEST_NULL;
  };
  MPI_Comm comm_;
  int tag_ = 0;
  std::span<double> refuge_;
  std::list<Sent> sent_;
  int fruitless_ = 0;
};

}  // namespace carillon::ldlt
