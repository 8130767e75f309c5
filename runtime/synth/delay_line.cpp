// Method:     ring buffer of the longest travel time, whose beginning is repeated behind its end, so that a window is contiguous.
#include "runtime/synth/delay_line.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "runtime/bank/bank.hpp"
#include "runtime/base/error.hpp"

namespace carillon::synth {

DelayLine::DelayLine(double longest_m, double sample_rate_hz, int block) {
  if (!(longest_m >= 0.0) || !(longest_m < 1e5)) throw InputError("delay line: the longest distance must be below 100 km");
  if (!(sample_rate_hz > 0.0) || block < 1) throw InputError("delay line: the sample rate and the block must be positive");
  size_ =
      static_cast<std::size_t>(std::ceil(longest_m / bank::kSoundSpeedMs * sample_rate_hz)) + 2 * kTaps + static_cast<std::size_t>(block);
  twice_ = kTaps + static_cast<std::size_t>(block);
  samples_.assign(size_ + twice_, 0.0F);
}

void DelayLine::push(std::span<const float> samples) noexcept {
  for (std::size_t n = samples.size(); n > 0; --n) {
    if (samples[n - 1] == 0.0F) continue;
    loud_end_ = position_ + static_cast<std::int64_t>(n);
    break;
  }
  while (!samples.empty()) {
    const auto piece = samples.first(std::min(samples.size(), size_ - next_));
    std::copy(piece.begin(), piece.end(), samples_.begin() + static_cast<std::ptrdiff_t>(next_));
    if (next_ < twice_) {
      const auto again = piece.first(std::min(piece.size(), twice_ - next_));
      std::copy(again.begin(), again.end(), samples_.begin() + static_cast<std::ptrdiff_t>(size_ + next_));
    }
    next_ = next_ + piece.size() == size_ ? 0 : next_ + piece.size();
    position_ += static_cast<std::int64_t>(piece.size());
    samples = samples.subspan(piece.size());
  }
}

void DelayLine::push_silence(std::int64_t samples) noexcept {
  constexpr std::array<float, 64> kZeros{};
  for (; samples > 0 && !is_silent();) {
    const std::int64_t count = std::min<std::int64_t>(samples, kZeros.size());
    push(std::span(kZeros).first(count));
    samples -= count;
  }
  position_ += samples;
}

}  // namespace carillon::synth
