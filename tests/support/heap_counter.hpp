// operator new that counts, and fails on request: only in test_heap, which links heap_counter.cpp.
#pragma once

#include <atomic>
#include <cstddef>

namespace carillon::tests {

/// Since program start; deallocations are not subtracted.
inline std::atomic<long> g_allocations{0}, g_bytes{0};
/// Successful allocations before one fails, once; negative: none fails.
inline std::atomic<long> g_until_failure{-1};

}  // namespace carillon::tests
