// From a finished simulation to the pressure at two ears or any microphones.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "runtime/bank/bank.hpp"
#include "runtime/contact/events.hpp"
#include "runtime/host/scene.hpp"

namespace carillon::host {

/// What is heard, and how much work it was.
struct Sound {
  int rate_hz = 0;
  // Per channel (left and right ear, or microphones), all of the same length.
  std::vector<std::vector<double>> pressure_pa = std::vector<std::vector<double>>(2);
  int modes = 0;                     // of all bodies, below Nyquist
  std::vector<int> body_modes;       // per body
  std::vector<double> body_peak_pa;  // per body, at 1 m
  std::int64_t strikes = 0;          // impulses that were played
  std::int64_t refused = 0;          // impulses that could not be (too many at once, not finite)
  std::int64_t resets = 0;           // bodies cleared because their state was no number
  double seconds_cpu = 0.0;
};

/// Renders round(duration * rate) samples. banks[i] belongs to scene.bodies[i]; the simulation to the same bodies in the same order.
/// `progress` (may be empty) is called with the finished fraction.
Sound calc_sound(const Scene& scene, const std::vector<const bank::Bank*>& banks, const contact::Simulation& simulation, int rate_hz,
                 const std::function<void(double)>& progress = {});

/// Largest absolute pressure of all channels [Pa].
double calc_peak_pa(const Sound& sound);

/// Levels re 20 uPa, unweighted, the mean square of all channels: of the whole, and of the loudest 125 ms. Minus infinity for silence.
struct Levels {
  double mean_db = 0.0;
  double loudest_db = 0.0;
};
Levels calc_levels(const Sound& sound);

/// The gain [full scale per Pa] that goes into the file. A given gain that would clip is reduced to the one of "auto".
struct Gain {
  double per_pa = 1.0;
  bool reduced = false;
};
Gain calc_gain(const Output& output, double peak_pa);

}  // namespace carillon::host
