// From a finished simulation to the pressure at two ears or any microphones.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "runtime/bank/bank.hpp"
#include "runtime/host/planning.hpp"
#include "runtime/host/scene.hpp"
#include "runtime/stream/events.hpp"
#include "runtime/synth/effects.hpp"
#include "runtime/synth/synthesiser.hpp"

namespace carillon::host {

/// What is heard, and how much work it was.
struct Sound {
  int rate_hz = 0;
  // Per channel (left and right ear, or microphones), all of the same length.
  std::vector<std::vector<double>> pressure_pa = std::vector<std::vector<double>>(2);
  int modes = 0;                                       // of all bodies, below Nyquist
  std::vector<int> body_modes;                         // per body
  std::vector<double> body_peak_pa;                    // per body, at 1 m
  double energy_rise = 0.0;                            // Synthesiser::get_energy_rise, the most of any body; where it is audited
  std::int64_t strikes = 0;                            // impulses that were played
  std::int64_t refused = 0;                            // impulses that could not be (too many at once, not finite)
  std::int64_t resets = 0;                             // bodies cleared because their state was no number
  std::vector<synth::EffectSet> body_effects;          // per body, what it had at any time
  std::vector<synth::EffectCounters> effect_counters;  // per body, at the end
  double seconds_per_tick = 0.0;                       // of the counters' ticks; 0 where they were not asked for
  double seconds_cpu = 0.0;
  double seconds_playing_cpu = 0.0;  // of them for what is done block by block
};

struct RenderOptions {
  int rate_hz = 48000;
  const Plan* plan = nullptr;              // whose changes the bodies follow; without, all bodies have the scene's effects
  bool measures = false;                   // what each effect of each body costs
  bool audits = false;                     // the energy of the modes
  std::function<void(double)> progress{};  // may be empty; called with the finished fraction
};

/// Renders round(duration * rate) samples. banks[i] belongs to scene.bodies[i]; body i of the events, which are in order of time, is the
/// same. A body to which nothing happens gets no effects.
Sound calc_sound(const Scene& scene, const std::vector<const bank::Bank*>& banks, std::span<const stream::Event> events,
                 const RenderOptions& options);

/// What of its effects a body of the scene can have: nothing pushes one that is fixed, and microphones stay where they are put.
synth::EffectSet find_effects(const Scene& scene, std::size_t body, synth::EffectSet effects);

/// Mode-samples that a second of sound may take: quality.modes at all times, or as many as there are.
double calc_budget(const Quality& quality, double rate_hz);

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
