// Clocks in seconds.
// Source: POSIX.1-2008, clock_gettime; Linux clock_gettime(2), CLOCK_BOOTTIME.
#pragma once

#include <time.h>

#include <cstdint>

namespace carillon::base {

inline std::uint64_t read_clock_ns(clockid_t clock) noexcept {
  timespec now{};
  ::clock_gettime(clock, &now);
  return static_cast<std::uint64_t>(now.tv_sec) * 1'000'000'000U + static_cast<std::uint64_t>(now.tv_nsec);
}
inline double read_clock(clockid_t clock) noexcept { return 1e-9 * static_cast<double>(read_clock_ns(clock)); }

/// Processor time of the calling thread.
inline double get_thread_cpu_s() noexcept { return read_clock(CLOCK_THREAD_CPUTIME_ID); }
/// Processor time of all threads of this process.
inline double get_process_cpu_s() noexcept { return read_clock(CLOCK_PROCESS_CPUTIME_ID); }

/// Monotonic clock, arbitrary origin; excludes suspended time.
inline double get_steady_s() noexcept { return read_clock(CLOCK_MONOTONIC); }
/// Monotonic clock since boot; includes suspended time.
inline double get_boot_s() noexcept { return read_clock(CLOCK_BOOTTIME); }

}  // namespace carillon::base
