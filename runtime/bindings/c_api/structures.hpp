// Structures of the C interface, of any version of the caller: they begin with their size, and later versions have more fields.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>

#include "runtime/bindings/c_api/carillon.h"

namespace carillon::c_api {

/// The first size of a structure, below those of all callers: for a structure that has grown, up to its first new field.
template <typename T>
inline constexpr std::size_t kMinSize = sizeof(T);
template <>
inline constexpr std::size_t kMinSize<carillon_options> = offsetof(carillon_options, head_radius_m);
template <>
inline constexpr std::size_t kMinSize<carillon_effect_counters> = offsetof(carillon_effect_counters, head_units);
template <>
inline constexpr std::size_t kMinSize<carillon_counters> = offsetof(carillon_counters, contacts_accepted);

/// The defaults of a structure; those other than 0 by specialisations.
template <typename T>
T make_default() {
  return T{};
}

/// Writes the defaults of as many fields as the caller's structure has.
template <typename T>
void init(T* given, size_t size) {
  if (given == nullptr || size < kMinSize<T>) return;
  T ours = make_default<T>();
  ours.size = static_cast<uint32_t>(std::min(size, sizeof(T)));
  std::memcpy(given, &ours, ours.size);
}

/// A structure of the caller's, with defaults for its missing fields; nothing for one that was not initialised.
template <typename T>
std::optional<T> read(const T* given) {
  if (given == nullptr || given->size < kMinSize<T>) return std::nullopt;
  T ours = make_default<T>();
  std::memcpy(&ours, given, std::min<std::size_t>(given->size, sizeof(T)));
  return ours;
}

/// Fills the fields of the caller's structure, which must have been initialised.
template <typename T>
void write(T ours, T* given) {
  ours.size = given->size;
  std::memcpy(given, &ours, std::min<std::size_t>(given->size, sizeof(T)));
}

}  // namespace carillon::c_api
