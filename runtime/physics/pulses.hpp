// Sound excitation by impacts: one pulse per spot and body.
#pragma once

#include <vector>

#include "runtime/events/events.hpp"
#include "runtime/physics/lasting.hpp"
#include "runtime/physics/rigid/space.hpp"

namespace carillon::physics {

/// Audibility of pulses per body, given its recent pulses: a settling heap hits its bodies thousands of times a second, mostly far below
/// their current sound.
class Masks {
 public:
  explicit Masks(int bodies) : masks_(static_cast<std::size_t>(bodies)) {}
  /// Records a pulse on a body [N s, s]. True if an earlier one masks it: one that was not longer, so that its spectrum reaches as high,
  /// and is 46 dB above it, plus 1 dB per 6 ms since. Call in time order, up to the length of a window.
  bool take(int body, double time_s, double impulse_n_s, double duration_s);

 private:
  struct Mask {
    double impulse_n_s = 0.0, time_s = 0.0, duration_s = 0.0;
  };
  std::vector<Mask> masks_;
};

/// Groups the points of an impact into spots, strongest first, and appends one pulse per spot and body; with masks only audible ones.
/// Notifies `lasting`.
void add_pulses(const rigid::Space& space, const rigid::Strike& strike, LastingContacts& lasting, Masks* masks,
                std::vector<events::Event>& events);

}  // namespace carillon::physics
