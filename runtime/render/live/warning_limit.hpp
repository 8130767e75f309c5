// A limit for warnings that anyone may cause.
#pragma once

#include <algorithm>
#include <cstdint>
#include <utility>

namespace carillon::live {

/// Ten warnings at once, then one a second: after a flood of them, warnings are heard again.
class WarningLimit {
 public:
  /// Number of warnings left out since the last one that was printed, or -1 to leave this one out as well. `now_s`: never decreases.
  std::int64_t pass(double now_s) {
    left_ = std::min(kAtOnce, left_ + (now_s - last_s_));
    last_s_ = now_s;
    if (left_ < 1.0) {
      ++left_out_;
      return -1;
    }
    left_ -= 1.0;
    return std::exchange(left_out_, 0);
  }

 private:
  static constexpr double kAtOnce = 10.0;

  double left_ = kAtOnce, last_s_ = 0.0;
  std::int64_t left_out_ = 0;
};

}  // namespace carillon::live
