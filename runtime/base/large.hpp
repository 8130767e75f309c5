// Allocation of large arrays.
#pragma once

#include <sys/mman.h>

#include <cstddef>
#include <cstdint>
#include <vector>

namespace carillon::base {

/// values.reserve(count) with a request for large pages: first-touch faults of 4 KiB pages cost more than the writes themselves. Append to
/// the reserved storage instead of overwriting zeros.
template <class T>
void reserve_large(std::vector<T>& values, std::size_t count) {
  values.reserve(count);
#if defined(MADV_HUGEPAGE)
  constexpr std::uintptr_t kLarge = std::uintptr_t{1} << 21;
  const auto begin = (reinterpret_cast<std::uintptr_t>(values.data()) + kLarge - 1) / kLarge * kLarge;
  const auto end = reinterpret_cast<std::uintptr_t>(values.data() + values.capacity()) / kLarge * kLarge;
  if (begin < end) ::madvise(reinterpret_cast<void*>(begin), end - begin, MADV_HUGEPAGE);  // advice only
#endif
}

}  // namespace carillon::base
