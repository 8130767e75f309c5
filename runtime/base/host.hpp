// Cores and memory available to this process.
#pragma once

#include <cstdint>

namespace carillon::base {

struct Host {
  int cores = 1;              // usable by this process: affinity and control group
  double total_gb = 0.0;      // machine memory, or the control group's limit if lower
  double available_gb = 0.0;  // available now without swapping
};
Host find_host();

/// Memory of this process [byte].
struct Memory {
  std::int64_t address_space = 0, resident = 0;
  std::int64_t peak = 0;  // maximum of `resident` since exec; without VmHWM in /proc it may include the parent process
};
Memory find_memory();

/// Remaining address space under RLIMIT_AS [byte]; the largest number without a limit.
std::int64_t find_address_space_left();

}  // namespace carillon::base
