// Storage of the filters: rows in blocks of lanes, and their last frames. Internal to carillon::emission.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "precompute/simulation/emission/loops.hpp"
#include "runtime/base/bytes.hpp"

namespace carillon::emission {

struct alignas(64) Block {
  std::array<double, kLane> value{};
};

/// Rows at one time, or successive ones. Invariant: aligned to 64 bytes.
class Rows {
 public:
  Rows() = default;
  /// Pre: a multiple of kLane.
  explicit Rows(std::size_t rows) : blocks_(rows / kLane) {}
  double* get() { return blocks_.empty() ? nullptr : blocks_.front().value.data(); }
  const double* get() const { return blocks_.empty() ? nullptr : blocks_.front().value.data(); }
  std::vector<Block>& get_blocks() { return blocks_; }

 private:
  std::vector<Block> blocks_;
};

/// Last frames of rows. Invariant: the frames of a block are contiguous, for filters that read them together.
class Ring {
 public:
  Ring(std::size_t rows, std::size_t frames)
      : frames_(frames), memory_(rows * (frames + 1)) {}  // one more: avoids strides that alias in the cache
  std::size_t get_stride() const { return (frames_ + 1) * kLane; }
  std::size_t find_offset(std::int64_t frame) const {
    const auto count = static_cast<std::int64_t>(frames_);
    return static_cast<std::size_t>((frame % count + count) % count) * kLane;
  }
  /// From a row on that begins a block.
  Frames get(std::size_t row = 0) { return {memory_.get() + row / kLane * get_stride(), get_stride()}; }
  Frames get(std::size_t row, std::int64_t frame) { return {get(row).data + find_offset(frame), get_stride()}; }
  std::vector<Block>& get_blocks() { return memory_.get_blocks(); }

 private:
  std::size_t frames_;
  Rows memory_;
};

/// Appends state to the bytes of a checkpoint.
struct Saver {
  std::vector<std::byte>& to;
  template <typename... Values>
  void operator()(const Values&... values) {
    (put(values), ...);
  }

 private:
  template <typename T>
  void put(const T& value) {
    base::put(to, value);
  }
  template <typename T>
  void put(const std::vector<T>& values) {
    base::put_list(to, values);
  }
};

/// Extracts it from their front, in the same order.
struct Loader {
  std::span<const std::byte>& from;
  template <typename... Values>
  void operator()(Values&... values) {
    (take(values), ...);
  }

 private:
  template <typename T>
  void take(T& value) {
    value = base::take<T>(from);
  }
  template <typename T>
  void take(std::vector<T>& values) {
    base::take_list(from, values);
  }
};

}  // namespace carillon::emission
