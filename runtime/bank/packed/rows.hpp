// Predicted shapes of all modes at the vertices: in steps of each mode, single precision.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "runtime/base/large.hpp"

namespace carillon::packed {

inline constexpr std::size_t kRowUnit = 16;  // padding of the modes to whole vectors of all instruction sets

/// A row is the x, y, z of all modes: (3, padded), zero-padded.
class Rows {
 public:
  Rows(std::size_t vertices, std::size_t modes) : padded_((modes + kRowUnit - 1) / kRowUnit * kRowUnit) {
    base::reserve_large(values_, vertices * 3 * padded_ + kRowUnit);
    // Align rows to cache lines: vectors across two lines take twice the time.
    values_.resize((kLine - reinterpret_cast<std::uintptr_t>(values_.data()) % kLine) % kLine / sizeof(float));
    first_ = values_.size();
  }
  std::size_t get_padded() const { return padded_; }
  std::size_t get_width() const { return 3 * padded_; }
  const float* get(std::size_t vertex) const { return values_.data() + first_ + vertex * get_width(); }
  /// Row of the next vertex; within the reserved storage.
  void append(std::span<const float> row) { values_.insert(values_.end(), row.begin(), row.end()); }

 private:
  static constexpr std::uintptr_t kLine = 64;  // cache line [byte]
  std::size_t padded_, first_ = 0;
  std::vector<float> values_;
};

}  // namespace carillon::packed
