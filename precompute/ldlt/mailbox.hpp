// Messages of numbers between ranks that work on their own fronts meanwhile.
#pragma once

#include <mpi.h>

#include <cstdint>
#include <list>
#include <memory>
#include <optional>
#include <span>

#include "precompute/ldlt/buffer.hpp"

namespace carillon::ldlt {

/// Says what the numbers are for.
struct Heading {
  std::int32_t kind = 0;
  std::int32_t front = 0;
  std::int32_t place = 0;  // of the sender
  std::int32_t index = 0;
};

/// Numbers behind their heading, aligned for vectors.
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
  static constexpr std::int64_t kHeadingNumbers = 8;  // the numbers behind begin with a line of the cache
  Buffer data_;
};

/// Sends letters and takes those that have come, in any order; what a rank sends to another stays in order. All ranks of a communicator use
/// the same tag, and no one else does.
class Mailbox {
 public:
  /// refuge: takes the numbers of a letter for which there is no memory; what was in it is lost then. It must outlive this.
  Mailbox(MPI_Comm comm, int tag, std::span<double> refuge) : comm_(comm), tag_(tag), refuge_(refuge) {}

  void send(int rank, Letter letter);
  /// The letter stays the caller's, who may read it, and gives it up after the last send.
  void send(int rank, const std::shared_ptr<const Letter>& letter);
  /// A letter that has arrived, if there is one. Throws std::bad_alloc; the letter is lost then.
  std::optional<Letter> receive();
  /// Lets go of what has been sent. Returns whether all has.
  bool release();
  /// Gives the core to another process after a while in which nothing came.
  void rest();

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
