#include "runtime/synth/cpu_ticks.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <thread>

namespace carillon::synth {
namespace {

// Whatever the machine does meanwhile: a thread that sleeps takes no time, and one that works takes some.
TEST(CpuTicks, TimeIsThatOfTheThreadAndOfItsWorkAlone) {
  (void)get_cpu_ticks();
  const std::uint64_t begin = get_cpu_ticks();
  std::this_thread::sleep_for(std::chrono::milliseconds(200));
  const auto slept = static_cast<std::int64_t>(get_cpu_ticks() - begin);
  EXPECT_LT(slept, 100'000'000);
  volatile double sum = 0.0;
  for (int i = 0; i < 20'000'000; ++i) sum = sum + 1.0 / (1.0 + i);
  const auto worked = static_cast<std::int64_t>(get_cpu_ticks() - begin);
  EXPECT_GT(worked, slept + 1'000'000);
  // A thousand questions cost what they cost, and are not in the answer.
  const std::uint64_t before = get_cpu_ticks(), cost = get_cpu_ticks_cost_ns();
  for (int i = 0; i < 1000; ++i) (void)get_cpu_ticks();
  EXPECT_GE(get_cpu_ticks_cost_ns(), cost + 1000);
  EXPECT_GT(static_cast<std::int64_t>(get_cpu_ticks() - before), -1'000'000);
}

}  // namespace
}  // namespace carillon::synth
