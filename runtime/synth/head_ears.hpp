// Head filter of one body and one path.
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

/// Sound at both ears of a head from one body by one path: straight, or by the floor. The input is the sound at the centre of the head
/// without the head, with delay and spreading of the path; the filter adds the head's own delays and levels. Invariant: silent and in its
/// initial state once the response to all input has ended, which depends on the samples only, not on the block sizes. [audio-thread] except
/// the constructor.
class HeadEars {
 public:
  /// Allocates all memory.
  explicit HeadEars(std::shared_ptr<const head::Head> head);
  HeadEars(HeadEars&&) noexcept;
  ~HeadEars();

  /// Adds the sound at both ears of at most a sub-block [Pa], get_latency() of the head later. `direction`: to the source at its end, in
  /// the frame of the head; the filter cross-fades from the direction of the last call. Zeros cost nothing once the output is silent.
  void process(const Vec3& direction, std::span<const double> input, std::span<double> left, std::span<double> right) noexcept;

  /// The response to all input has ended.
  bool is_silent() const noexcept { return left_ == 0; }

 private:
  std::unique_ptr<head::EarFilter> filter_;
  int left_ = 0;  // samples until the output is silent
};

}  // namespace carillon::synth
