// Serialisation of trivially copyable values for checkpoints.
//
//   std::vector<std::byte> bytes;
//   base::put(bytes, head), base::put_list(bytes, values);
//   std::span<const std::byte> from = bytes;                  // take() advances it
//   const auto head = base::take<Head>(from);
//   const std::vector<double> values = base::take_list<double>(from);
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <type_traits>
#include <utility>
#include <vector>

#include "runtime/base/error.hpp"

namespace carillon::base {

template <typename T>
void put(std::vector<std::byte>& to, const T& value) {
  static_assert(std::is_trivially_copyable_v<T>);
  const auto bytes = std::as_bytes(std::span(&value, 1));
  to.insert(to.end(), bytes.begin(), bytes.end());
}

/// Length, then the values.
template <typename T>
void put_list(std::vector<std::byte>& to, const std::vector<T>& values) {
  put(to, static_cast<std::uint64_t>(values.size()));
  const auto bytes = std::as_bytes(std::span(values));
  to.insert(to.end(), bytes.begin(), bytes.end());
}

/// Throws InputError when `from` is too short.
template <typename T>
T take(std::span<const std::byte>& from) {
  static_assert(std::is_trivially_copyable_v<T>);
  if (from.size() < sizeof(T)) throw InputError("the checkpoint is truncated; remove it and run again");
  T value;
  std::memcpy(&value, from.data(), sizeof(T));
  from = from.subspan(sizeof(T));
  return value;
}

/// Throws InputError when `from` is shorter than the stored length.
template <typename T>
std::vector<T> take_list(std::span<const std::byte>& from) {
  static_assert(std::is_trivially_copyable_v<T>);
  const auto count = take<std::uint64_t>(from);
  if (count > from.size() / sizeof(T)) throw InputError("the checkpoint is truncated; remove it and run again");
  std::vector<T> values(count);
  if (count > 0) std::memcpy(values.data(), from.data(), values.size() * sizeof(T));
  from = from.subspan(values.size() * sizeof(T));
  return values;
}

/// Throws InputError when the stored length differs from values.size().
template <typename T>
void take_list(std::span<const std::byte>& from, std::vector<T>& values) {
  std::vector<T> taken = take_list<T>(from);
  if (taken.size() != values.size())
    throw InputError("the checkpoint belongs to other bodies or another number of ranks; remove it and run again");
  values = std::move(taken);
}

}  // namespace carillon::base
