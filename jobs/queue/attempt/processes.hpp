// The processes below one: what they are, what they use.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <map>
#include <string>

namespace carillon::attempt {

struct Usage {
  pid_t parent = 0;
  std::string name;  // at most 15 letters
  std::uint64_t resident_bytes = 0;
  std::uint64_t cpu_ns = 0;  // its own, ended children not counted
};

/// All processes of this machine that descend from `root`, and itself. Zombies are left out.
std::map<pid_t, Usage> find_below(pid_t root);

/// CPU time of `pid` and all below it in `all` [ns].
std::uint64_t calc_cpu_below(const std::map<pid_t, Usage>& all, pid_t pid);

/// How often the kernel has killed a process for lack of memory since it started; 0 where it is not known.
std::uint64_t find_memory_kills();

}  // namespace carillon::attempt
