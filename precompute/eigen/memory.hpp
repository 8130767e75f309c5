// Checks free memory before large allocations.
#pragma once

#include <mpi.h>

#include <cstdint>
#include <string>

#include "precompute/comm/communicator.hpp"

namespace carillon::eigen {

/// Throws SystemError on all ranks alike when the ranks of some host need more than it has left: memory the machine can give (MemAvailable
/// of /proc/meminfo, the process's cgroup), the address space each process may take (RLIMIT_AS), or `limit_bytes` for all ranks of a host
/// together, if that is not 0. need_bytes: what this rank is about to allocate. what: "The factorisation of K - sigma M". Collective.
void check_memory(const comm::Communicator& comm, std::int64_t need_bytes, std::int64_t limit_bytes, const std::string& what);

/// What this process may still take [byte]: of the machine, its cgroups and its own limit. Local.
std::int64_t find_memory_left();

}  // namespace carillon::eigen
