// Method:     a value that lies between two samples is added to the 12 samples before and the 12 behind it, with the weights of the kernel
//             at their distances (polyphase). No step is ever convolved twice, and no history of steps is kept.
// Source:     OCE01 eq. 6 to 8 (kHann2001); Kaiser 1974.
// Deviations: kFlat has another window and another band than OCE01: its kernel is 6 dB down at fmax and folds what lies above.
#include "precompute/emission/low_pass.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "runtime/base/bytes.hpp"

namespace carillon::emission {
namespace {

constexpr double kBeta = 6.25;

double calc_bessel_i0(double x) {
  double term = 1.0, sum = 1.0;
  for (int k = 1; term > 1e-17 * sum; ++k) {
    term *= 0.25 * x * x / (static_cast<double>(k) * k);
    sum += term;
  }
  return sum;
}

/// At x samples from the middle.
double calc_kernel(Kernel kernel, double x, double half) {
  const double sinc = x == 0.0 ? 1.0 : std::sin(std::numbers::pi * x) / (std::numbers::pi * x);
  if (std::abs(x) > half) return 0.0;
  if (kernel == Kernel::kHann2001) return sinc * (0.5 + 0.5 * std::cos(std::numbers::pi * x / half));
  return sinc * calc_bessel_i0(kBeta * std::sqrt(std::max(0.0, 1.0 - x * x / (half * half))));
}

}  // namespace

LowPass::LowPass(std::size_t rows, Kernel kernel)
    : rows_(rows), kernel_(kernel), loops_(&find_loops()), open_(rows * kSlots, 0.0), last_(rows, 0.0), waiting_(rows * kTogether, 0.0) {}

void LowPass::set_rate(int values, double first, double half_width) {
  take_in();  // by the weights that it came with
  const double half = kernel_ == Kernel::kFlat ? kHalf : half_width;
  weight_.resize(static_cast<std::size_t>(values));
  moment_.resize(weight_.size());
  double total = 0.0;
  for (int i = 0; i < values; ++i)
    for (int s = 0; s < kSlots; ++s) {
      const double x = (first + i) / values + (kHalf - 1) - s;
      const double w = calc_kernel(kernel_, x, half);
      total += w;
      const auto n = static_cast<std::size_t>(i);
      const auto at = static_cast<std::size_t>(s);
      weight_[n][at] = w;
      moment_[n][at] = w * x;
    }
  for (std::size_t n = 0; n < weight_.size(); ++n)
    for (std::size_t s = 0; s < kSlots; ++s) {
      weight_[n][s + kSlots] = weight_[n][s] /= total;
      moment_[n][s + kSlots] = moment_[n][s] /= total;
    }
}

void LowPass::add(int i, const double* value) {
  // Slot s of the ring has the weight of place (s - ring_) mod kSlots.
  const auto begin = static_cast<std::size_t>((kSlots - ring_) % kSlots);
  const double* weight = weight_[static_cast<std::size_t>(i)].data() + begin;
  const double* moment = moment_[static_cast<std::size_t>(i)].data() + begin;
  std::copy_n(value, rows_, waiting_.begin() + static_cast<std::ptrdiff_t>(waiting_count_ * rows_));
  waiting_weight_[waiting_count_++] = weight;
  if (waiting_count_ == kTogether) take_in();
  for (std::size_t s = 0; s < kSlots; ++s) {
    weights_[s] += weight[s];
    moments_[s] += moment[s];
  }
}

void LowPass::take_in() {
  loops_->add_rows(open_.data(), waiting_.data(), rows_, waiting_weight_.data(), waiting_count_);
  waiting_count_ = 0;
}

void LowPass::close(double* out) {
  take_in();
  const auto slot = static_cast<std::size_t>(ring_);
  const double scale = weights_[slot] > 0.0 ? 1.0 / weights_[slot] : 0.0;
  const double shift = kernel_ == Kernel::kFlat && has_last_ ? moments_[slot] * scale : 0.0;  // in samples
  for (std::size_t row = 0; row < rows_; ++row) {
    double& open = open_[row * kSlots + slot];
    const double x = open * scale;
    // A value at time t of a uniform motion is x + (t - now) speed, and the speed is (x - last) / (1 + shift).
    out[row] = x - shift / (1.0 + shift) * (x - last_[row]);
    last_[row] = out[row];
    open = 0.0;
  }
  weights_[slot] = moments_[slot] = 0.0;
  has_last_ = true;
  ring_ = (ring_ + 1) % kSlots;
}

void LowPass::save(std::vector<std::byte>& to) {
  take_in();  // the order of the sum is the same
  base::put(to, ring_);
  base::put(to, weights_);
  base::put(to, moments_);
  base::put(to, has_last_);
  base::put_list(to, open_);
  base::put_list(to, last_);
}

void LowPass::load(std::span<const std::byte>& from) {
  waiting_count_ = 0;
  ring_ = base::take<int>(from);
  weights_ = base::take<std::array<double, kSlots>>(from);
  moments_ = base::take<std::array<double, kSlots>>(from);
  has_last_ = base::take<bool>(from);
  base::take_list(from, open_);
  base::take_list(from, last_);
}

}  // namespace carillon::emission
