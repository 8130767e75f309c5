// Method:     CLOCK_THREAD_CPUTIME_ID; the first call of a thread measures what a call costs, the least of some rounds, and every further
//             one takes so much off.
// Source:     POSIX.1-2008, clock_gettime.
// Deviations: none.
#include "runtime/synth/cpu_ticks.hpp"

#include <algorithm>
#include <ctime>

#include "runtime/base/clock.hpp"

namespace carillon::synth {
namespace {

struct Cost {
  std::uint64_t one_ns = 0;  // of a call
  std::uint64_t all_ns = 0;  // of all so far
  Cost() noexcept {
    constexpr int kCalls = 20, kRounds = 5;
    std::uint64_t min = ~std::uint64_t{0};
    for (int round = 0; round < kRounds; ++round) {
      const std::uint64_t begin = base::read_clock_ns(CLOCK_THREAD_CPUTIME_ID);
      std::uint64_t end = begin;
      for (int i = 0; i < kCalls; ++i) end = base::read_clock_ns(CLOCK_THREAD_CPUTIME_ID);
      min = std::min(min, end - begin);
    }
    one_ns = min / kCalls;
  }
};

Cost& get_cost() noexcept {
  thread_local Cost cost;
  return cost;
}

}  // namespace

std::uint64_t get_cpu_ticks() noexcept {
  Cost& cost = get_cost();
  cost.all_ns += cost.one_ns;
  return base::read_clock_ns(CLOCK_THREAD_CPUTIME_ID) - cost.all_ns;
}

std::uint64_t get_cpu_ticks_cost_ns() noexcept { return get_cost().all_ns; }

}  // namespace carillon::synth
