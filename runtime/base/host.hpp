// What the machine can give, and what this process has taken of it.
#pragma once

#include <cstdint>

namespace carillon::base {

struct Host {
  int cores = 1;              // that this process may run on: affinity, and what a control group allows
  double total_gb = 0.0;      // memory of the machine, or of the control group where that is less
  double available_gb = 0.0;  // of it, what could be taken now without swapping
};
Host find_host();

/// Memory of this process [byte].
struct Memory {
  std::int64_t address_space = 0, resident = 0;
  std::int64_t peak = 0;  // highest `resident` since exec; where /proc lacks VmHWM it may include the program that started this one
};
Memory find_memory();

/// What RLIMIT_AS leaves this process of address space [byte]; the largest number where there is no limit.
std::int64_t find_address_space_left();

}  // namespace carillon::base
