// A head's two ears for one body.
#pragma once

#include <cstddef>
#include <memory>
#include <span>

#include "runtime/base/vector.hpp"

namespace carillon::head {
class EarFilter;
class Head;
}  // namespace carillon::head

namespace carillon::synth {

/// What both ears of a head hear of the sound of one body that comes by one way: straight, or from a floor. The sound comes as it would be
/// in the middle of the head without it, with the delay and the spreading of the way to there; the head's own delays and levels are what
/// the ears differ by. Invariant: it is silent, and as it was made, once all that came in is out; when that is follows from
/// the samples alone, not from how many come in one call of who feeds it. [audio-thread] but for the constructor.
class HeadEars {
 public:
  /// Takes all memory that it needs.
  explicit HeadEars(std::shared_ptr<const head::Head> head);
  HeadEars(HeadEars&&) noexcept;
  ~HeadEars();

  /// Adds what both ears hear of a sub-block or less [Pa], get_latency() of the head later. `direction`: to the source at its end, in the
  /// frame of the head; from the direction of the last call to this one the head's filter fades over the call. Zeros that come when all is
  /// out cost nothing.
  void process(const Vec3& direction, std::span<const double> input, std::span<double> left, std::span<double> right) noexcept;

  /// All that came in is out.
  bool is_silent() const noexcept { return left_ == 0; }

 private:
  std::unique_ptr<head::EarFilter> filter_;
  int left_ = 0;  // samples until all is out
};

}  // namespace carillon::synth
