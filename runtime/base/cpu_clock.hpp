// Processor time: what others do on a busy machine is not in it.
// Source: POSIX.1-2008, clock_gettime, getrusage.
#pragma once

#include <sys/resource.h>
#include <time.h>

#include <cstdint>

namespace carillon::base {

inline std::uint64_t get_thread_cpu_ns() noexcept {
  timespec now{};
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<std::uint64_t>(now.tv_sec) * 1'000'000'000U + static_cast<std::uint64_t>(now.tv_nsec);
}

/// Of the calling thread.
inline double get_thread_cpu_s() noexcept { return 1e-9 * static_cast<double>(get_thread_cpu_ns()); }

/// Of this process, all its threads.
inline double get_process_cpu_s() noexcept {
  timespec now{};
  ::clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

/// Of the programs that this process started and that have ended.
inline double get_children_cpu_s() noexcept {
  rusage used{};
  ::getrusage(RUSAGE_CHILDREN, &used);
  return static_cast<double>(used.ru_utime.tv_sec + used.ru_stime.tv_sec) +
         1e-6 * static_cast<double>(used.ru_utime.tv_usec + used.ru_stime.tv_usec);
}

}  // namespace carillon::base
