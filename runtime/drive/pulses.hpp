// Sound excitation by impacts: one pulse per spot and body.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "runtime/drive/scene.hpp"
#include "runtime/events/events.hpp"

namespace carillon::drive {

/// The force of an impact at one spot as a pulse on each of its bodies.
struct Blow {
  int a = 0, b = -1;
  double touch_s = 0.0;                // begin of the pulse
  double masked_s = 0.0;               // time for Masks, in order
  double duration_s = 0.0;             // of the Hertz pulse
  double impulse_n_s = 0.0;            // magnitude
  std::array<Vec3, 2> impulses_n_s{};  // on a and b, mesh axes
  std::array<geometry::Place, 2> places{};
};

/// Audibility of pulses per body, given its recent pulses: a settling heap hits its bodies thousands of times a second, mostly far below
/// their current sound.
class Masks {
 public:
  explicit Masks(int bodies) : masks_(static_cast<std::size_t>(bodies)) {}
  /// Records a pulse on a body [N s, s]. True if an earlier one masks it: one that was not longer, so that its spectrum reaches as high,
  /// and is 46 dB above it, plus 1 dB per 6 ms since. Call in time order, up to the length of a window.
  bool take(int body, double time_s, double impulse_n_s, double duration_s);
  /// Of a new body.
  void forget(int body) { masks_[body] = {}; }
  void resize(int bodies) { masks_.resize(static_cast<std::size_t>(bodies)); }

 private:
  struct Mask {
    double impulse_n_s = 0.0, time_s = 0.0, duration_s = 0.0;
  };
  std::vector<Mask> masks_;
};

/// Appends the pulses of a blow on bodies with a shape; with masks only audible ones. Returns their number.
int add_pulses(const Scene& scene, const Blow& blow, Masks* masks, std::vector<events::Event>& events);

}  // namespace carillon::drive
