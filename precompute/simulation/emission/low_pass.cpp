// Method: a value between two samples is added to the samples around it with the kernel weights at their distances (polyphase): each step
//   is convolved once, without a step history.
// Source: OCE01 eq. 6 to 8.
#include "precompute/simulation/emission/low_pass.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace carillon::emission {
namespace {

/// At x samples from the centre.
double calc_kernel(double x, double half) {
  if (std::abs(x) > half) return 0.0;
  const double sinc = x == 0.0 ? 1.0 : std::sin(std::numbers::pi * x) / (std::numbers::pi * x);
  return sinc * (0.5 + 0.5 * std::cos(std::numbers::pi * x / half));
}

}  // namespace

LowPass::LowPass(std::size_t rows, int values, double first)
    : rows_(rows), weight_(static_cast<std::size_t>(values)), open_(rows * kSlots, 0.0), waiting_(rows * kValuesPerCall, 0.0) {
  double total = 0.0;
  for (int i = 0; i < values; ++i)
    for (int s = 0; s < kSlots; ++s) total += weight_[i][s] = calc_kernel((first + i) / values + (kHalf - 1) - s, kHalfWidth);
  for (auto& weight : weight_)
    for (std::size_t s = 0; s < kSlots; ++s) weight[s + kSlots] = weight[s] /= total;
}

void LowPass::add(int i, const double* value) {
  // Slot s of the ring has the weight of position (s - ring_) mod kSlots.
  const double* weight = weight_[i].data() + (kSlots - ring_) % kSlots;
  std::copy_n(value, rows_, waiting_.begin() + static_cast<std::ptrdiff_t>(waiting_count_ * rows_));
  waiting_weight_[waiting_count_++] = weight;
  if (waiting_count_ == kValuesPerCall) take_in();
  for (std::size_t s = 0; s < kSlots; ++s) weights_[s] += weight[s];
}

void LowPass::take_in() {
  loops_->add_rows(open_.data(), waiting_.data(), rows_, waiting_weight_.data(), waiting_count_);
  waiting_count_ = 0;
}

void LowPass::close(double* out) {
  take_in();
  const std::size_t slot = ring_;
  const double scale = weights_[slot] > 0.0 ? 1.0 / weights_[slot] : 0.0;
  for (std::size_t row = 0; row < rows_; ++row) {
    double& open = open_[row * kSlots + slot];
    out[row] = open * scale;
    open = 0.0;
  }
  weights_[slot] = 0.0;
  ring_ = (ring_ + 1) % kSlots;
}

}  // namespace carillon::emission
