// Processor time of the calling thread: what others do on a busy machine is not in it.
// Source: POSIX.1-2008, clock_gettime, CLOCK_THREAD_CPUTIME_ID.
#pragma once

#include <time.h>

#include <cstdint>

namespace carillon::config {

inline std::uint64_t get_thread_cpu_ns() noexcept {
  timespec now{};
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<std::uint64_t>(now.tv_sec) * 1'000'000'000U + static_cast<std::uint64_t>(now.tv_nsec);
}

inline double get_thread_cpu_s() noexcept { return 1e-9 * static_cast<double>(get_thread_cpu_ns()); }

}  // namespace carillon::config
