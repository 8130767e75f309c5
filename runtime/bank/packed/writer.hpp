// Writer of numbers and compressed blocks.
#pragma once

#include <concepts>
#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

namespace carillon::packed {

/// Counterpart of Reader.
class Writer {
 public:
  template <class T>
  requires std::integral<T> || std::floating_point<T>
  void put(T value) {
    bytes_.resize(bytes_.size() + sizeof value);
    std::memcpy(bytes_.data() + bytes_.size() - sizeof value, &value, sizeof value);
  }
  template <class T>
  void put_list(std::span<const T> values) {
    for (const T value : values) put(value);
  }
  /// SystemError if out of memory.
  void put_block(std::span<const std::uint8_t> block);
  /// Counterpart of Reader::get_numbers().
  void put_numbers(std::span<const std::uint32_t> values);

  const std::vector<std::uint8_t>& get_bytes() const { return bytes_; }

 private:
  std::vector<std::uint8_t> bytes_;
};

}  // namespace carillon::packed
