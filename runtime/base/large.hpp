// Memory for arrays of megabytes.
#pragma once

#include <sys/mman.h>

#include <cstddef>
#include <cstdint>
#include <vector>

namespace carillon::base {

/// As values.reserve(count). Asks for large pages, where the system has them: a page of 4 KiB that is touched for the first time costs
/// more than the writing of it. To append what comes then is cheaper than to overwrite zeros.
template <class T>
void reserve_large(std::vector<T>& values, std::size_t count) {
  values.reserve(count);
#if defined(MADV_HUGEPAGE)
  constexpr std::uintptr_t kLarge = std::uintptr_t{1} << 21;
  const auto begin = (reinterpret_cast<std::uintptr_t>(values.data()) + kLarge - 1) / kLarge * kLarge;
  const auto end = reinterpret_cast<std::uintptr_t>(values.data() + values.capacity()) / kLarge * kLarge;
  if (begin < end) ::madvise(reinterpret_cast<void*>(begin), end - begin, MADV_HUGEPAGE);  // advice: nothing depends on it
#endif
}

}  // namespace carillon::base
