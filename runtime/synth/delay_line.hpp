// Delay line of the pressure that a body has emitted.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "runtime/synth/kernels.hpp"

namespace carillon::synth {

/// The last samples of one source, shared by all microphones. Sample 0 is the first that was pushed; before it there was silence.
class DelayLine {
 public:
  /// Takes memory for travel times up to `longest_m` metres, read after at most `block` samples were pushed at once. Throws InputError for
  /// more than 100 km, a rate or a block that is not positive.
  DelayLine(double longest_m, double sample_rate_hz, int block);

  /// [audio-thread]: no heap, no lock, no throw. At most `block` samples.
  void push(std::span<const float> samples) noexcept;

  /// [audio-thread] As a push of so many zeros. Free when all is silent already, and then for any number.
  void push_silence(std::int64_t samples) noexcept;

  /// [audio-thread] Nothing that is still on its way can be heard.
  bool is_silent() const noexcept { return loud_end_ == 0 || loud_end_ + static_cast<std::int64_t>(size_) <= position_; }

  /// [audio-thread] `count` <= kTaps + block samples from `first` on, or nullptr when they are silent, forgotten or not there yet.
  const float* find(std::int64_t first, std::int64_t count = kTaps) const noexcept {
    const std::int64_t back = position_ - first;  // from what comes next
    if (first + count <= 0 || first >= loud_end_ || back < count || back > static_cast<std::int64_t>(size_)) return nullptr;
    const std::int64_t at = static_cast<std::int64_t>(next_) - back;
    return samples_.data() + (at < 0 ? at + static_cast<std::int64_t>(size_) : at);
  }

  /// How many samples find() has in a row at most: kTaps + block.
  std::int64_t get_longest_row() const noexcept { return static_cast<std::int64_t>(twice_); }
  std::int64_t get_size() const noexcept { return static_cast<std::int64_t>(size_); }
  /// Of the next sample. [audio-thread]
  std::int64_t get_position() const noexcept { return position_; }
  std::size_t get_bytes() const noexcept { return samples_.size() * sizeof(float); }

 private:
  std::size_t size_ = 0;        // of the ring
  std::size_t twice_ = 0;       // so many from its beginning stand behind its end once more, so that what is read together lies in a row
  std::vector<float> samples_;  // size_ + twice_
  std::size_t next_ = 0;        // place of the next sample
  std::int64_t position_ = 0;   // samples pushed
  std::int64_t loud_end_ = 0;   // behind the last sample that was not zero
};

}  // namespace carillon::synth
