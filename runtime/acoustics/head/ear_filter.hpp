// Head filter of one source.
#pragma once

#include <array>
#include <cstddef>
#include <memory>
#include <span>
#include <vector>

#include "runtime/acoustics/head/convolve.hpp"
#include "runtime/acoustics/head/head.hpp"
#include "runtime/base/sinc.hpp"

namespace carillon::head {

using base::kSincTaps;

/// Maps the pressure at the centre of a head to the pressure at its ears; one per body and listener. Invariant: every input sample is
/// filtered by the response and delay of its direction, cross-faded over the block when the direction changes; at a constant direction the
/// bits do not depend on the block sizes. Direction changes cause no step of level or pitch.
///
/// The response is convolved first, in the time domain; then each ear's delay is applied: whole samples, and a sinc for the fraction.
class EarFilter {
 public:
  /// Allocates all memory.
  explicit EarFilter(std::shared_ptr<const Head> head);

  /// Adds the pressure at both ears [Pa]. `input`: pressure at the centre of the head without the head, any length (32 to 128 samples are
  /// cheapest); `left`, `right`: the same length. `direction`: to the source at the end of the block, in the frame of the head (x forward,
  /// y left, z up), any length; zero or non-finite: straight ahead. Over the block the filter of the last direction cross-fades linearly
  /// into the new one; the first call begins at its own. Latency: Head::get_latency(). [audio-thread]: no heap, no lock, no throw. Four
  /// convolutions if the direction changes, else two.
  void process(const Vec3& direction, std::span<const double> input, std::span<double> left, std::span<double> right) noexcept;

  /// Clears all state. [audio-thread]
  void reset() noexcept;

  const Head& get_head() const noexcept { return *head_; }
  /// Length of the response to one input sample, including it [samples].
  int get_length() const noexcept;

 private:
  /// Filter of one direction, for both ears.
  struct Filter {
    std::array<Blend, 2> blend{};
    std::array<std::vector<float>, 2> response;
    std::array<int, 2> whole{};  // samples of delay
    std::array<std::array<float, kSincTaps>, 2> fraction{};
  };
  /// History of a signal, contiguous in memory.
  struct Line {
    std::vector<float> samples;
    std::size_t at = 0, kept = 0;

    void reserve(std::size_t keep);
    /// Appends space for `count` <= kChunk samples and returns it.
    float* extend(std::size_t count) noexcept;
  };

  void set(Filter& filter, const std::array<Blend, 2>& blend) const noexcept;

  std::shared_ptr<const Head> head_;
  const Loops* loops_;
  std::array<Filter, 2> filters_;
  std::size_t now_ = 0;  // index of the current filter
  bool is_placed_ = false;
  Line input_;
  std::array<Line, 2> ears_;
};

}  // namespace carillon::head
