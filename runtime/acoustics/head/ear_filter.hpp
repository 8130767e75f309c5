// One source heard through a head.
#pragma once

#include <array>
#include <cstddef>
#include <memory>
#include <span>
#include <vector>

#include "runtime/base/sinc.hpp"
#include "runtime/acoustics/head/convolve.hpp"
#include "runtime/acoustics/head/head.hpp"

namespace carillon::head {

using base::kSincTaps;

/// From the pressure at the middle of a head to that at its ears; one for each body and listener. Invariant: every sample that
/// came in is heard with the response and the delay of the direction at its time, or with both of two directions while one fades into the
/// other; while the direction stays the same, calls of any size give the same bits. Neither the level nor the pitch steps when the
/// direction does.
///
/// The response is convolved first, in the time domain, and what it gives is delayed by each ear's delay, a whole number of samples and a
/// sinc for the rest.
class EarFilter {
 public:
  /// Takes all memory that it needs.
  explicit EarFilter(std::shared_ptr<const Head> head);

  /// Adds what both ears hear of a block [Pa]; `input` (any length; 32 to 128 samples are cheapest) is the pressure at the middle of the
  /// head, were it not there; `left` and `right` are as long. `direction`: of the source at the end of the block, in the frame of the head
  /// (x forward, y left, z up), any length; of no length or not finite: straight ahead. Over the block the filter of the direction of the
  /// last call fades linearly into that of this one; the first call begins at its own. The output lags by Head::get_latency() samples.
  /// [audio-thread]: no heap, no lock, no throw. Costs four convolutions where the direction changes and two where it does not.
  void process(const Vec3& direction, std::span<const double> input, std::span<double> left, std::span<double> right) noexcept;

  /// As it was when it was made. [audio-thread]
  void reset() noexcept;

  const Head& get_head() const noexcept { return *head_; }
  /// Samples, one of the input and those behind it, in which that one is heard.
  int get_length() const noexcept;

 private:
  /// What one direction does, for both ears.
  struct Filter {
    std::array<Blend, 2> blend{};
    std::array<std::vector<float>, 2> response;
    std::array<int, 2> whole{};  // samples of delay
    std::array<std::array<float, kSincTaps>, 2> fraction{};
  };
  /// The last samples of a signal, one after the other in memory.
  struct Line {
    std::vector<float> samples;
    std::size_t at = 0, kept = 0;

    void reserve(std::size_t keep);
    /// Room for up to kChunk samples behind the last ones; `count` of them will be there.
    float* extend(std::size_t count) noexcept;
  };

  void set(Filter& filter, const std::array<Blend, 2>& blend) const noexcept;

  std::shared_ptr<const Head> head_;
  const Loops* loops_;
  std::array<Filter, 2> filters_;
  std::size_t now_ = 0;  // which of them
  bool is_placed_ = false;
  Line input_;
  std::array<Line, 2> ears_;
};

}  // namespace carillon::head
