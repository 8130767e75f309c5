// Microphones and their arriving sound.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "precompute/comm/communicator.hpp"
#include "precompute/simulation/emission/loops.hpp"
#include "runtime/acoustics/recording/player.hpp"
#include "runtime/base/vector.hpp"

namespace carillon::emission {

using recording::Microphone;

/// Left and right omnidirectional ears, distance_m apart on a horizontal line (z is up) normal to the view (OCE01 section 4). Throws
/// InputError for a view without direction or straight up or down.
std::vector<Microphone> make_ears(const Vec3& position_m, const Vec3& look_at_m, double distance_m = 0.2);

/// Pressure over time at one point. Invariant: half-samples are integers in units of 2^-46 Pa, so that sums are bit-identical in any order
/// and on any number of ranks.
class Arrivals {
 public:
  explicit Arrivals(std::size_t frames);

  /// Pressures of a source sample [Pa], arriving `time` half-samples later: flat to 0.4 of the sample rate. Drops samples after the end.
  /// False: dropped one that is not finite or over 1e4 Pa.
  bool add(std::int64_t sample, std::span<const double> time, const double* pressure_pa);

  /// (frames) Pa, of all ranks. Collective.
  std::vector<double> sum(const comm::Communicator& comm) const;

  template <typename Visit>
  void visit_state(Visit&& visit) {
    visit(units_);
  }

 private:
  const RowLoops* loops_;
  std::size_t frames_;
  std::vector<std::int64_t> units_;  // by half-samples, from -kReach on
};

}  // namespace carillon::emission
