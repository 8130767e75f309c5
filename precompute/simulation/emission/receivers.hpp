// Microphones, and the sound that has arrived at them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "precompute/comm/communicator.hpp"
#include "precompute/simulation/emission/loops.hpp"
#include "runtime/base/vector.hpp"
#include "runtime/acoustics/recording/player.hpp"

namespace carillon::emission {

using recording::Microphone;

/// The left and the right one of two omnidirectional ears, distance_m apart on a horizontal line (z is up) at right angles to the view
/// (OCE01 section 4). Throws InputError when the view has no direction or goes straight up or down.
std::vector<Microphone> make_ears(const Vec3& position_m, const Vec3& look_at_m, double distance_m = 0.2);

/// Pressure over time at one place. Invariant: half-samples are whole numbers of 2^-46 Pa, so that their sums have the same bits
/// in any order and on any number of ranks.
class Arrivals {
 public:
  explicit Arrivals(std::size_t frames);

  /// Pressures of a source sample [Pa], heard `time` half-samples after it: flat to 0.4 of the sample rate. Samples after the end are
  /// left out. False: one is not finite or over 1e4 Pa; it is left out.
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
