// Method:     y(t) = sum over k of x_k h((t - k) / stretch), divided by the sum of the weights.
// Source:     docs/equations.md E14 (the sinc).
#include "runtime/acoustics/recording/resampler.hpp"

#include <algorithm>
#include <cmath>

#include "runtime/base/sinc.hpp"

namespace carillon::recording {

Resampler::Resampler(double from_hz, double to_hz)
    : step_(from_hz / to_hz),
      stretch_(std::max(1.0, from_hz / to_hz)),
      reach_(static_cast<std::int64_t>(std::ceil(base::kSincHalf * stretch_))) {
  input_.assign(reach_, 0.0);
  first_ = -reach_;
}

std::size_t Resampler::count_missing(std::size_t outputs) const {
  if (outputs == 0) return 0;
  const double last = static_cast<double>(taken_ + outputs - 1) * step_;
  const std::int64_t end = static_cast<std::int64_t>(std::floor(last)) + reach_ + 1;
  return std::max<std::int64_t>(0, end - first_ - static_cast<std::int64_t>(input_.size()));
}

void Resampler::add(std::span<const double> input) { input_.insert(input_.end(), input.begin(), input.end()); }

void Resampler::take(std::span<double> output) {
  const base::Sinc& sinc = base::Sinc::get();
  for (double& y : output) {
    const double at = static_cast<double>(taken_++) * step_;
    const auto middle = static_cast<std::int64_t>(std::floor(at));
    double sum = 0.0, weights = 0.0;
    for (std::int64_t k = middle - reach_ + 1; k <= middle + reach_; ++k) {
      const double weight = sinc.evaluate((at - static_cast<double>(k)) / stretch_);
      sum += weight * input_[k - first_];
      weights += weight;
    }
    y = sum / weights;
  }
  const std::int64_t needed = static_cast<std::int64_t>(std::floor(static_cast<double>(taken_) * step_)) - reach_ + 1;
  const std::int64_t gone = std::clamp<std::int64_t>(needed - first_, 0, static_cast<std::int64_t>(input_.size()));
  input_.erase(input_.begin(), input_.begin() + static_cast<std::ptrdiff_t>(gone));
  first_ += gone;
}

}  // namespace carillon::recording
