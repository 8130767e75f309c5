// The shapes of all modes at the vertices, as they are predicted: in steps of each mode, single precision.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "runtime/base/large.hpp"

namespace carillon::packed {

inline constexpr std::size_t kRowUnit = 16;  // modes come in multiples of this, whole vectors of every kind

/// A row is the x of all modes, then the y, then the z: (3, padded), with zeros behind the last mode.
class Rows {
 public:
  Rows(std::size_t vertices, std::size_t modes) : padded_((modes + kRowUnit - 1) / kRowUnit * kRowUnit) {
    base::reserve_large(values_, vertices * 3 * padded_ + kRowUnit);
    // Rows begin with lines of the cache: a vector that lies across two of them takes twice the time.
    values_.resize((kLine - reinterpret_cast<std::uintptr_t>(values_.data()) % kLine) % kLine / sizeof(float));
    first_ = values_.size();
  }
  std::size_t get_padded() const { return padded_; }
  std::size_t get_width() const { return 3 * padded_; }
  const float* get(std::size_t vertex) const { return values_.data() + first_ + vertex * get_width(); }
  /// The row of the next vertex; there is room for it.
  void append(std::span<const float> row) { values_.insert(values_.end(), row.begin(), row.end()); }

 private:
  static constexpr std::uintptr_t kLine = 64;  // bytes
  std::size_t padded_, first_ = 0;
  std::vector<float> values_;
};

}  // namespace carillon::packed
