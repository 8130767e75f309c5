// operator new replaced by one that counts: in test_heap alone, which links heap_counter.cpp.
#pragma once

#include <atomic>
#include <cstddef>

namespace carillon::tests {

/// Since the start of the program; what is given back does not count.
inline std::atomic<long> g_allocations{0}, g_bytes{0};

}  // namespace carillon::tests
