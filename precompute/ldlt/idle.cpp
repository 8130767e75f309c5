// Polling intervals of an idle rank. The simulated cluster of tests/bench/scaling has a blocking version.
#include <sched.h>
#include <time.h>

#include "precompute/ldlt/mailbox.hpp"

namespace carillon::ldlt {

void Mailbox::rest(bool /*is_expecting*/) {
  constexpr int kPatience = 200;
  constexpr int kLongPatience = 2000;
  ++fruitless_;
  if (fruitless_ > kLongPatience) {
    const timespec pause{0, 20'000};
    nanosleep(&pause, nullptr);
  } else if (fruitless_ > kPatience) {
    sched_yield();
  }
}

}  // namespace carillon::ldlt
