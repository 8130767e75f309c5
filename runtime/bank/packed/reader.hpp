// Numbers and compressed blocks out of untrusted bytes.
#pragma once

#include <concepts>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace carillon::packed {

/// A signed number as an unsigned one, small where it is small: 0, -1, 1, -2, 2 ... as 0, 1, 2, 3, 4 ...
constexpr std::uint32_t fold(std::int32_t value) { return (static_cast<std::uint32_t>(value) << 1) ^ (value < 0 ? 0xffffffffU : 0U); }
constexpr std::int32_t unfold(std::uint32_t folded) {
  return static_cast<std::int32_t>((folded >> 1) ^ ((folded & 1U) != 0 ? 0xffffffffU : 0U));
}

/// Reads from front to back. What does not fit ends in an InputError that names the bank and says what is wrong; no block takes more
/// memory than kMaxInflation times its bytes.
class Reader {
 public:
  /// `name` stands for the file in messages, `what` for the part of it: "packed surface".
  Reader(std::span<const std::byte> bytes, std::string name, std::string what)
      : bytes_(bytes), name_(std::move(name)), what_(std::move(what)) {}

  /// One little-endian number.
  template <class T>
  requires std::integral<T> || std::floating_point<T> T get() {
    T value;
    std::memcpy(&value, take(sizeof value).data(), sizeof value);
    return value;
  }
  /// A finite number greater than 0.
  double get_positive(std::string_view name);
  /// As many numbers.
  template <class T>
  std::vector<T> get_list(std::size_t count) {
    const auto from = take(count, sizeof(T));
    std::vector<T> values(count);
    if (count > 0) std::memcpy(values.data(), from.data(), from.size());
    return values;
  }
  /// A block of so many bytes: four bytes that say how long its zlib stream is, and the stream.
  std::vector<std::uint8_t> get_block(std::size_t size);
  /// So many numbers: how many bytes each has, 0 to 4, a block of their lowest bytes, one of the next ...
  std::vector<std::uint32_t> get_numbers(std::size_t count);
  std::size_t get_left() const { return bytes_.size(); }
  /// Nothing may follow.
  void finish();

  [[noreturn]] void fail(std::string_view fault) const;

 private:
  std::span<const std::byte> take(std::size_t count, std::size_t size = 1);

  std::span<const std::byte> bytes_;
  std::string name_, what_;
};

}  // namespace carillon::packed
