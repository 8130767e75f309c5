// Plain values to and from the bytes of a checkpoint. Internal to carillon::emission.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <type_traits>
#include <vector>

#include "runtime/base/error.hpp"

namespace carillon::emission {

template <typename T>
void put(std::vector<std::byte>& to, const T& value) {
  static_assert(std::is_trivially_copyable_v<T>);
  const auto bytes = std::as_bytes(std::span(&value, 1));
  to.insert(to.end(), bytes.begin(), bytes.end());
}

template <typename T>
void put_list(std::vector<std::byte>& to, const std::vector<T>& values) {
  put(to, static_cast<std::uint64_t>(values.size()));
  const auto bytes = std::as_bytes(std::span(values));
  to.insert(to.end(), bytes.begin(), bytes.end());
}

/// Throws InputError when there are fewer bytes.
template <typename T>
T take(std::span<const std::byte>& from) {
  static_assert(std::is_trivially_copyable_v<T>);
  if (from.size() < sizeof(T)) throw InputError("the state of the sound is cut off; remove the checkpoint and run again");
  T value;
  std::memcpy(&value, from.data(), sizeof(T));
  from = from.subspan(sizeof(T));
  return value;
}

/// Into a list of the length that it has. Throws InputError when the bytes are of another surface.
template <typename T>
void take_list(std::span<const std::byte>& from, std::vector<T>& values) {
  const auto count = take<std::uint64_t>(from);
  if (count != values.size() || from.size() < count * sizeof(T))
    throw InputError("the state of the sound is of another surface or of other ranks; remove the checkpoint and run again");
  if (count > 0) std::memcpy(values.data(), from.data(), count * sizeof(T));
  from = from.subspan(count * sizeof(T));
}

}  // namespace carillon::emission
