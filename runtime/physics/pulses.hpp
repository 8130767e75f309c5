// What an impact gives to the sound: one pulse for every spot and body.
#pragma once

#include <vector>

#include "runtime/physics/lasting.hpp"
#include "runtime/events/events.hpp"
#include "runtime/physics/rigid/space.hpp"

namespace carillon::physics {

/// What each body was struck with lately, as it fades from hearing: a heap that settles taps its bodies thousands of times a second, most
/// of them far below what rings there already.
class Masks {
 public:
  explicit Masks(int bodies) : masks_(static_cast<std::size_t>(bodies)) {}
  /// Takes note of a pulse on a body [N s, s]. True if one before it hides it: that one was no longer, so that its spectrum reaches as
  /// high, and is 46 dB above it, 1 dB more for every 6 ms since. In order of time, but for the length of a window.
  bool take(int body, double time_s, double impulse_n_s, double duration_s);

 private:
  struct Mask {
    double impulse_n_s = 0.0, time_s = 0.0, duration_s = 0.0;
  };
  std::vector<Mask> masks_;
};

/// Gathers the points of an impact into spots, strongest first, and appends one pulse a spot and body; with masks only
/// where it is heard. `lasting` is notified of it.
void add_pulses(const rigid::Space& space, const rigid::Strike& strike, LastingContacts& lasting, Masks* masks,
                std::vector<events::Event>& events);

}  // namespace carillon::physics
