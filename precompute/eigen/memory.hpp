// Checks free memory before large allocations.
#pragma once

#include <mpi.h>

#include <cstdint>
#include <string>

#include "precompute/comm/communicator.hpp"

namespace carillon::eigen {

/// Throws SystemError on all ranks if the ranks of some host need more memory than available: MemAvailable of /proc/meminfo and the cgroup
/// of the process, the address space of each process (RLIMIT_AS), or `limit_bytes` for all ranks of a host together, if not 0. need_bytes:
/// size of the coming allocation on this rank. what: subject of the message, "The factorisation of K - sigma M". Collective.
void check_memory(const comm::Communicator& comm, std::int64_t need_bytes, std::int64_t limit_bytes, const std::string& what);

/// Memory that this process may still allocate [byte], limited by machine, cgroups and its own limit. Local.
std::int64_t find_memory_left();

}  // namespace carillon::eigen
