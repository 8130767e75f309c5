#include "runtime/base/host.hpp"

#include <gtest/gtest.h>
#include <sched.h>
#include <sys/resource.h>

#include <limits>
#include <vector>

#include "runtime/base/clock.hpp"

namespace carillon::base {
namespace {

TEST(Host, cores_respect_affinity) {
  cpu_set_t before, one;
  ASSERT_EQ(::sched_getaffinity(0, sizeof before, &before), 0);
  EXPECT_LE(find_host().cores, CPU_COUNT(&before));
  int first = 0;
  while (!CPU_ISSET(first, &before)) ++first;
  CPU_ZERO(&one);
  CPU_SET(first, &one);
  ASSERT_EQ(::sched_setaffinity(0, sizeof one, &one), 0);
  EXPECT_EQ(find_host().cores, 1);
  ::sched_setaffinity(0, sizeof before, &before);
}

TEST(Host, has_memory) {
  const Host host = find_host();
  EXPECT_GT(host.available_gb, 0.01);
  EXPECT_GE(host.total_gb, host.available_gb);
  EXPECT_LT(host.total_gb, 1e6);
}

TEST(Memory, grows_with_touched_pages_and_keeps_the_peak) {
  constexpr std::int64_t kBytes = 64 << 20;
  const Memory before = find_memory();
  EXPECT_GE(before.address_space, before.resident);
  {
    std::vector<char> block(kBytes, 1);
    EXPECT_EQ(block.back(), 1);
    EXPECT_GE(find_memory().resident, kBytes);
  }
  EXPECT_GE(find_memory().peak, kBytes);
}

TEST(Memory, a_limit_leaves_the_remainder) {
  EXPECT_EQ(find_address_space_left(), std::numeric_limits<std::int64_t>::max()) << "ulimit -v is set";
  rlimit before{};
  ::getrlimit(RLIMIT_AS, &before);
  const std::int64_t taken = find_memory().address_space;
  rlimit limit = before;
  limit.rlim_cur = static_cast<rlim_t>(taken) + (rlim_t{1} << 30);
  ::setrlimit(RLIMIT_AS, &limit);
  const std::int64_t left = find_address_space_left();
  ::setrlimit(RLIMIT_AS, &before);
  EXPECT_NEAR(static_cast<double>(left), 0x1p30, 0x1p24);
}

TEST(CpuClock, of_the_process_includes_the_thread) {
  volatile double x = 0.0;
  // Process readings enclose the thread's: on a busy machine time passes between readings.
  const double process_s = get_process_cpu_s(), thread_s = get_thread_cpu_s();
  double used_s = 0.0;
  while ((used_s = get_thread_cpu_s() - thread_s) < 0.02) x = x + 1.0;
  EXPECT_GE(get_process_cpu_s() - process_s, used_s - 1e-9);  // clock resolution 1 ns
}

}  // namespace
}  // namespace carillon::base
