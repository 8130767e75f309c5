#include "tests/support/heap_counter.hpp"

#include <cstdlib>
#include <new>

namespace carillon::tests {
namespace {

/// False: the allocation must fail.
bool count_allocation(std::size_t size) noexcept {
  ++g_allocations;
  g_bytes += static_cast<long>(size);
  return g_until_failure < 0 || g_until_failure-- != 0;
}

}  // namespace
}  // namespace carillon::tests

// The array forms and the aligned non-throwing form call these (C++20, [new.delete]).
[[gnu::noinline]] void* operator new(std::size_t size) {
  const bool succeeds = carillon::tests::count_allocation(size);
  if (void* memory = succeeds ? std::malloc(size) : nullptr) return memory;
  throw std::bad_alloc();
}
[[gnu::noinline]] void* operator new(std::size_t size, std::align_val_t align) {
  const bool succeeds = carillon::tests::count_allocation(size);
  const auto a = static_cast<std::size_t>(align);
  if (void* memory = succeeds ? std::aligned_alloc(a, (size + a - 1) / a * a) : nullptr) return memory;
  throw std::bad_alloc();
}
[[gnu::noinline]] void* operator new(std::size_t size, const std::nothrow_t&) noexcept {
  return carillon::tests::count_allocation(size) ? std::malloc(size) : nullptr;
}
[[gnu::noinline]] void operator delete(void* memory, const std::nothrow_t&) noexcept { std::free(memory); }
[[gnu::noinline]] void operator delete(void* memory) noexcept { std::free(memory); }
[[gnu::noinline]] void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }
[[gnu::noinline]] void operator delete(void* memory, std::align_val_t) noexcept { std::free(memory); }
[[gnu::noinline]] void operator delete(void* memory, std::size_t, std::align_val_t) noexcept { std::free(memory); }
