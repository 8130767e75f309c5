// From a finished simulation to the pressure at two ears or any microphones.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "runtime/bank/bank.hpp"
#include "runtime/events/events.hpp"
#include "runtime/scene/events.hpp"
#include "runtime/scene/planning.hpp"
#include "runtime/scene/scene.hpp"
#include "runtime/render/surface_playback.hpp"
#include "runtime/render/sound/sound_store.hpp"
#include "runtime/synth/effects.hpp"
#include "runtime/synth/synthesiser.hpp"

namespace carillon::render {

/// Levels re 20 uPa, unweighted, the mean square of all channels: of the whole, and of the loudest 125 ms. Minus infinity for silence.
struct Levels {
  double mean_db = 0.0;
  double loudest_db = 0.0;
};

/// Peak and levels of a sound that goes by.
class Meter {
 public:
  Meter(int rate_hz, std::size_t channels);
  /// Whole frames, channels interleaved [Pa].
  void add(std::span<const float> frames);
  /// Largest absolute pressure of all channels [Pa].
  double get_peak_pa() const { return peak_pa_; }
  Levels calc_levels() const;

 private:
  std::size_t channels_ = 0, window_ = 0;  // frames
  std::uint64_t frames_ = 0;
  double sum_ = 0.0, total_ = 0.0, loudest_ = 0.0, peak_pa_ = 0.0;  // sum_: of the window so far
};

/// What is heard, and how much work it was.
struct Sound {
  int rate_hz = 0;
  std::size_t channels = 0;  // left and right ear, or microphones
  std::uint64_t frames = 0;
  double peak_pa = 0.0;
  Levels levels;
  double faded_s = 0.0;                                // of its end; 0: it is silent there, or the scene sets no fade
  int modes = 0;                                       // of all bodies, below Nyquist
  std::vector<int> body_modes;                         // per body
  std::vector<double> body_peak_pa;                    // per body, at 1 m
  std::vector<double> body_deflection;                 // per body, Synthesiser::get_deflection
  double energy_rise = 0.0;                            // Synthesiser::get_energy_rise, the most of any body; where it is audited
  synth::ModeEnergy mode_energy;                       // Synthesiser::get_mode_energy, of all bodies; with audits
  double max_modes_j = 0.0;                            // largest energy of the modes of all bodies at once
  std::int64_t strikes = 0;                            // impulses that were played
  std::int64_t refused = 0;                            // events that could not be: too many at once
  std::int64_t faults = 0;                             // events that no synthesiser plays: numbers that are not finite ...
  std::int64_t resets = 0;                             // bodies cleared because their state was no number
  std::vector<synth::EffectSet> body_effects;          // per body
  std::vector<synth::EffectCounters> effect_counters;  // per body, at the end
  std::vector<SurfaceFigures> surfaces;                // per recorded surface of the scene
  double seconds_cpu = 0.0;
  double seconds_playing_cpu = 0.0;  // of them for what is done block by block
};

struct RenderOptions {
  int rate_hz = 48000;
  const scene::Plan* plan = nullptr;  // choice of effects; nullptr: all bodies have the scene's effects
  bool audits = false;         // the energy of the modes
  bool fades_end = false;      // what still sounds at the end goes to zero within kFadeS
  /// make_head() of the scene at that rate, where it was made before; nullptr: it is made here.
  const std::optional<synth::ListeningHead>* head = nullptr;
  std::function<void(double)> progress{};  // may be empty; called with the finished fraction
};

/// The sound that is cut off fades within this time at its end, unless it has become this much softer than its peak: half a step of 16
/// bits, -96 dB.
inline constexpr double kFadeS = 0.01;
inline constexpr double kFadeShare = 1.0 / 65536.0;

/// Renders round(duration * rate) frames of the scene, whose recordings are read (read_surfaces()), into `store`, which has the scene's
/// channels and the rate. banks[i] belongs to scene.bodies[i]; body i of the events (as EventPlayback takes them) is the same. A body to
/// which nothing happens gets no effects.
Sound calc_sound(const scene::Scene& scene, const std::vector<const bank::Bank*>& banks, const scene::Events& events, const RenderOptions& options,
                 sound::SoundStore& store);

/// Warning of a deflection beyond the range of linear modes, else empty. `thicknesses`: Sound::body_deflection.
std::string describe_bending(const std::string& name, const bank::Bank& bank, double thicknesses);

/// Of a sound of that length.
std::uint64_t count_frames(double duration_s, int rate_hz);

/// The gain [full scale per Pa] that goes into the file. A given gain that would clip is reduced to the one of "auto".
struct Gain {
  double per_pa = 1.0;
  bool reduced = false;
};
Gain calc_gain(const scene::Output& output, double peak_pa);

}  // namespace carillon::render
