#include "tests/support/heap_counter.hpp"

#include <cstdlib>
#include <new>

namespace carillon::tests {
namespace {

void count_allocation(std::size_t size) noexcept {
  ++g_allocations;
  g_bytes += static_cast<long>(size);
}

}  // namespace
}  // namespace carillon::tests

// Those for arrays, and the aligned one that does not throw, call these (C++20, [new.delete]).
[[gnu::noinline]] void* operator new(std::size_t size) {
  carillon::tests::count_allocation(size);
  if (void* memory = std::malloc(size)) return memory;
  throw std::bad_alloc();
}
[[gnu::noinline]] void* operator new(std::size_t size, std::align_val_t align) {
  carillon::tests::count_allocation(size);
  const auto a = static_cast<std::size_t>(align);
  if (void* memory = std::aligned_alloc(a, (size + a - 1) / a * a)) return memory;
  throw std::bad_alloc();
}
[[gnu::noinline]] void* operator new(std::size_t size, const std::nothrow_t&) noexcept {
  carillon::tests::count_allocation(size);
  return std::malloc(size);
}
[[gnu::noinline]] void operator delete(void* memory, const std::nothrow_t&) noexcept { std::free(memory); }
[[gnu::noinline]] void operator delete(void* memory) noexcept { std::free(memory); }
[[gnu::noinline]] void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }
[[gnu::noinline]] void operator delete(void* memory, std::align_val_t) noexcept { std::free(memory); }
[[gnu::noinline]] void operator delete(void* memory, std::size_t, std::align_val_t) noexcept { std::free(memory); }
