// Resource usage of a process and its descendants.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <map>
#include <string>

namespace carillon::attempt {

struct Usage {
  pid_t parent = 0;
  std::string name;  // at most 15 characters
  std::uint64_t resident_bytes = 0;
  std::uint64_t cpu_ns = 0;  // without ended children
};

/// `root` and its descendants, without zombies.
std::map<pid_t, Usage> find_below(pid_t root);

/// CPU time of `pid` and its descendants in `all` [ns].
std::uint64_t calc_cpu_below(const std::map<pid_t, Usage>& all, pid_t pid);

/// Number of processes killed by the kernel for lack of memory since boot; 0 if unknown.
std::uint64_t find_memory_kills();

}  // namespace carillon::attempt
