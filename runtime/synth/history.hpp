// What a body has sent out, kept for as long as the air carries it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace carillon::synth {

inline constexpr int kTaps = 32;  // samples that an ear reads at once

/// The last samples of one source, shared by all microphones. Sample 0 is the first that was pushed; before it there was silence.
class History {
 public:
  /// Takes memory for travel times up to `longest_m` metres, read after at most `block` samples were pushed at once. Throws InputError for
  /// more than 100 km, a rate or a block that is not positive.
  History(double longest_m, double sample_rate_hz, int block);

  /// [audio-thread]: no heap, no lock, no throw. At most `block` samples.
  void push(std::span<const float> samples) noexcept;

  /// [audio-thread] Silence for so many samples: of a source that comes later than sample 0. Before the first push only.
  void skip(std::int64_t samples) noexcept { position_ += samples; }

  /// [audio-thread] Nothing that is still on its way can be heard.
  bool is_silent() const noexcept { return loud_end_ == 0 || loud_end_ + static_cast<std::int64_t>(size_) <= position_; }

  /// [audio-thread] kTaps samples from `first` on, or nullptr when they are silent, forgotten or not there yet.
  const float* find(std::int64_t first) const noexcept {
    if (first + kTaps <= 0 || first >= loud_end_ || first + kTaps > position_ || first < position_ - static_cast<std::int64_t>(size_)) {
      return nullptr;
    }
    return samples_.data() + (static_cast<std::size_t>(first) & (size_ - 1));
  }

 private:
  std::size_t size_ = 0;        // a power of two
  std::vector<float> samples_;  // twice `size_`: every sample stands at two places, so that any kTaps lie in a row
  std::int64_t position_ = 0;   // samples pushed
  std::int64_t loud_end_ = 0;   // behind the last sample that was not zero
};

}  // namespace carillon::synth
