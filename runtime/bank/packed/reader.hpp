// Reader of numbers and compressed blocks from untrusted bytes.
#pragma once

#include <concepts>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace carillon::packed {

/// Zigzag code: 0, -1, 1, -2, 2 ... as 0, 1, 2, 3, 4 ...
constexpr std::uint32_t fold(std::int32_t value) { return (static_cast<std::uint32_t>(value) << 1) ^ (value < 0 ? 0xffffffffU : 0U); }
constexpr std::int32_t unfold(std::uint32_t folded) {
  return static_cast<std::int32_t>((folded >> 1) ^ ((folded & 1U) != 0 ? 0xffffffffU : 0U));
}

/// Sequential reader. Faults throw an InputError that names the bank and the fault; a block takes at most kMaxInflation times its bytes of
/// memory.
class Reader {
 public:
  /// `name`: file in messages, `what`: part of it ("packed surface").
  Reader(std::span<const std::byte> bytes, std::string name, std::string what)
      : bytes_(bytes), name_(std::move(name)), what_(std::move(what)) {}

  /// A little-endian number.
  template <class T>
  requires std::integral<T> || std::floating_point<T> T get() {
    T value;
    std::memcpy(&value, take(sizeof value).data(), sizeof value);
    return value;
  }
  /// A finite positive number.
  double get_positive(std::string_view name);
  /// `count` numbers.
  template <class T>
  std::vector<T> get_list(std::size_t count) {
    const auto from = take(count, sizeof(T));
    std::vector<T> values(count);
    if (count > 0) std::memcpy(values.data(), from.data(), from.size());
    return values;
  }
  /// A block of `size` bytes: length of its zlib stream (four bytes), and the stream.
  std::vector<std::uint8_t> get_block(std::size_t size);
  /// `count` numbers: bytes per number, 0 to 4, then blocks of the lowest bytes, the next ...
  std::vector<std::uint32_t> get_numbers(std::size_t count);
  std::size_t get_left() const { return bytes_.size(); }
  /// Fails if bytes are left.
  void finish();

  [[noreturn]] void fail(std::string_view fault) const;

 private:
  std::span<const std::byte> take(std::size_t count, std::size_t size = 1);

  std::span<const std::byte> bytes_;
  std::string name_, what_;
};

}  // namespace carillon::packed
