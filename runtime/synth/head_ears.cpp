// Method:     head::EarFilter on the grid of sub-blocks.
// Source:     docs/equations.md.
// Deviations: sources have the distance of the head's measurement; nearer ones are louder by 1 / r at both ears alike.
#include "runtime/synth/head_ears.hpp"

#include <algorithm>
#include <utility>

#include "runtime/acoustics/head/ear_filter.hpp"

namespace carillon::synth {

HeadEars::HeadEars(std::shared_ptr<const head::Head> head) : filter_(std::make_unique<head::EarFilter>(std::move(head))) {}

HeadEars::HeadEars(HeadEars&&) noexcept = default;
HeadEars::~HeadEars() = default;

void HeadEars::process(const Vec3& direction, std::span<const double> input, std::span<double> left, std::span<double> right) noexcept {
  const bool is_loud = std::any_of(input.begin(), input.end(), [](double p) { return p != 0.0; });
  if (is_loud) left_ = filter_->get_length();
  if (left_ == 0) return;
  filter_->process(direction, input, left, right);
  if (is_loud) return;
  left_ = std::max(0, left_ - static_cast<int>(input.size()));
  if (left_ == 0) filter_->reset();
}

}  // namespace carillon::synth
