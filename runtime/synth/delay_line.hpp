// Delay line of the pressure emitted by a body.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "runtime/synth/kernels.hpp"

namespace carillon::synth {

/// Last samples of one source, shared by all microphones. Sample 0 is the first pushed; silence before.
class DelayLine {
 public:
  /// Allocates for travel times up to `longest_m`, read after at most `block` pushed samples. Throws InputError for more than 100 km and
  /// for a rate or block that is not positive.
  DelayLine(double longest_m, double sample_rate_hz, int block);

  /// [audio-thread]: no heap, no lock, no throw. At most `block` samples.
  void push(std::span<const float> samples) noexcept;

  /// [audio-thread] Pushes zeros. Free if the line is silent.
  void push_silence(std::int64_t samples) noexcept;

  /// [audio-thread] True if all samples still in the line are zero.
  bool is_silent() const noexcept { return loud_end_ == 0 || loud_end_ + static_cast<std::int64_t>(size_) <= position_; }

  /// [audio-thread] `count` <= kTaps + block samples from `first` on; nullptr if they are silent, forgotten or not pushed yet.
  const float* find(std::int64_t first, std::int64_t count = kTaps) const noexcept {
    const std::int64_t back = position_ - first;  // distance from the next sample
    if (first + count <= 0 || first >= loud_end_ || back < count || back > static_cast<std::int64_t>(size_)) return nullptr;
    const std::int64_t at = static_cast<std::int64_t>(next_) - back;
    return samples_.data() + (at < 0 ? at + static_cast<std::int64_t>(size_) : at);
  }

  /// Largest contiguous read: kTaps + block.
  std::int64_t get_longest_row() const noexcept { return static_cast<std::int64_t>(twice_); }
  std::int64_t get_size() const noexcept { return static_cast<std::int64_t>(size_); }
  /// Number of the next sample. [audio-thread]
  std::int64_t get_position() const noexcept { return position_; }
  std::size_t get_bytes() const noexcept { return samples_.size() * sizeof(float); }

 private:
  std::size_t size_ = 0;        // ring size
  std::size_t twice_ = 0;       // first samples repeated behind the end, for contiguous reads
  std::vector<float> samples_;  // size_ + twice_
  std::size_t next_ = 0;        // write position
  std::int64_t position_ = 0;   // samples pushed
  std::int64_t loud_end_ = 0;   // end of the last non-zero sample
};

}  // namespace carillon::synth
