// operator new replaced by one that counts, and fails where a test asks for it: in test_heap alone, which links heap_counter.cpp.
#pragma once

#include <atomic>
#include <cstddef>

namespace carillon::tests {

/// Since the start of the program; what is given back does not count.
inline std::atomic<long> g_allocations{0}, g_bytes{0};
/// Allocations that still succeed; the one after them fails, once. Below 0: all succeed.
inline std::atomic<long> g_until_failure{-1};

}  // namespace carillon::tests
