// Structures of the C interface across versions: each begins with its size, and later versions append fields.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>

#include "runtime/bindings/c_api/carillon.h"

namespace carillon::c_api {

/// Size of a structure's first version: up to the first field added later.
template <typename T>
inline constexpr std::size_t kMinSize = sizeof(T);
template <>
inline constexpr std::size_t kMinSize<carillon_options> = offsetof(carillon_options, head_radius_m);
template <>
inline constexpr std::size_t kMinSize<carillon_effect_counters> = offsetof(carillon_effect_counters, head_units);
template <>
inline constexpr std::size_t kMinSize<carillon_motion> = offsetof(carillon_motion, cut);
template <>
inline constexpr std::size_t kMinSize<carillon_counters> = offsetof(carillon_counters, contacts_accepted);

/// Defaults of a structure; specialised where they are not 0.
template <typename T>
T make_default() {
  return T{};
}

/// Writes the defaults of the fields that the caller's structure has.
template <typename T>
void init(T* given, size_t size) {
  if (given == nullptr || size < kMinSize<T>) return;
  T ours = make_default<T>();
  ours.size = static_cast<uint32_t>(std::min(size, sizeof(T)));
  std::memcpy(given, &ours, ours.size);
}

/// The caller's structure with defaults for missing fields; empty if uninitialised.
template <typename T>
std::optional<T> read(const T* given) {
  if (given == nullptr || given->size < kMinSize<T>) return std::nullopt;
  T ours = make_default<T>();
  std::memcpy(&ours, given, std::min<std::size_t>(given->size, sizeof(T)));
  return ours;
}

/// Fills the fields of the caller's structure, which must be initialised.
template <typename T>
void write(T ours, T* given) {
  ours.size = given->size;
  std::memcpy(given, &ours, std::min<std::size_t>(given->size, sizeof(T)));
}

}  // namespace carillon::c_api
