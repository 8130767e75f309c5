// Method:     a ring of a power of two samples, written twice, so that a window of it is one piece of memory.
// Source:     textbook.
// Deviations: none.
#include "runtime/synth/history.hpp"

#include <bit>

#include "runtime/bank/bank.hpp"
#include "runtime/config/error.hpp"

namespace carillon::synth {

History::History(double longest_m, double sample_rate_hz, int block) {
  if (!(longest_m >= 0.0) || !(longest_m < 1e5)) throw InputError("a source must stay within 100 km of the listener");
  if (!(sample_rate_hz > 0.0) || block < 1) throw InputError("a history needs a positive sample rate and block");
  const double samples = longest_m / bank::kSoundSpeedMs * sample_rate_hz + 2.0 * kTaps + block;
  size_ = std::bit_ceil(static_cast<std::size_t>(samples));
  samples_.assign(2 * size_, 0.0F);
}

void History::push(std::span<const float> samples) noexcept {
  for (const float sample : samples) {
    const std::size_t at = static_cast<std::size_t>(position_++) & (size_ - 1);
    samples_[at] = samples_[at + size_] = sample;
    if (sample != 0.0F) loud_end_ = position_;
  }
}

}  // namespace carillon::synth
