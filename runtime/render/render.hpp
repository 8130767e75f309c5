// Synthesis of a finished simulation: pressure at two ears or any number of microphones.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "runtime/bank/bank.hpp"
#include "runtime/events/events.hpp"
#include "runtime/render/sound/sound_store.hpp"
#include "runtime/render/surface_playback.hpp"
#include "runtime/scene/events.hpp"
#include "runtime/scene/planning.hpp"
#include "runtime/scene/scene.hpp"
#include "runtime/synth/effects.hpp"
#include "runtime/synth/synthesiser.hpp"

namespace carillon::render {

/// Unweighted levels re 20 uPa, mean square over all channels: of the whole sound and of the loudest 125 ms. Silence: minus infinity.
struct Levels {
  double mean_db = 0.0;
  double loudest_db = 0.0;
};

/// Running peak and levels of a sound.
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
  double sum_ = 0.0, total_ = 0.0, loudest_ = 0.0, peak_pa_ = 0.0;  // sum_: current window
};

/// Figures of a rendered sound and its cost.
struct Sound {
  int rate_hz = 0;
  std::size_t channels = 0;  // left and right ear, or microphones
  std::uint64_t frames = 0;
  double peak_pa = 0.0;
  Levels levels;
  double faded_s = 0.0;                                // length of the final fade; 0: silent at the end, or no fade requested
  int modes = 0;                                       // all bodies, below Nyquist
  std::vector<int> body_modes;                         // per body
  std::vector<double> body_peak_pa;                    // per body, at 1 m
  std::vector<double> body_deflection;                 // per body, Synthesiser::get_deflection
  double energy_rise = 0.0;                            // Synthesiser::get_energy_rise, maximum over bodies; audits only
  synth::ModeEnergy mode_energy;                       // Synthesiser::get_mode_energy, all bodies; audits only
  double max_modes_j = 0.0;                            // largest total modal energy at any time
  std::int64_t strikes = 0;                            // impulses played
  std::int64_t refused = 0;                            // events rejected because a queue was full
  std::int64_t faults = 0;                             // invalid events, for example non-finite numbers
  std::int64_t resets = 0;                             // bodies cleared because their state was not finite
  std::vector<synth::EffectSet> body_effects;          // per body
  std::vector<synth::EffectCounters> effect_counters;  // per body, at the end
  std::vector<SurfaceFigures> surfaces;                // per recorded surface of the scene
  double seconds_cpu = 0.0;
  double seconds_playing_cpu = 0.0;  // block-by-block synthesis only
};

/// Energies of the modes during a sound.
struct ModalEnergies {
  static constexpr double kRateHz = 100.0;
  std::vector<double> time_s;   // (n) at least 1 / kRateHz apart
  std::vector<double> modes_j;  // (n, bodies)
};

struct RenderOptions {
  int rate_hz = 48000;
  const scene::Plan* plan = nullptr;  // choice of effects; nullptr: all bodies have the scene's effects
  bool audits = false;                // audit modal energy
  bool fades_end = false;             // fade a sound that is cut off within kFadeS
  /// make_head() of the scene at this rate, if already made; nullptr: made here.
  const std::optional<synth::ListeningHead>* head = nullptr;
  sound::SoundStore* sensors = nullptr;    // for the readings of the scene's sensors (SensorPlayback); nullptr: not read
  ModalEnergies* energies = nullptr;       // to be filled; nullptr: not measured
  std::function<void(double)> progress{};  // may be empty; called with the finished fraction
};

/// Length of the final fade, and the level re peak below which no fade is needed: half a step of 16 bits, -96 dB.
inline constexpr double kFadeS = 0.01;
inline constexpr double kFadeShare = 1.0 / 65536.0;

/// Renders round(duration * rate) frames of the scene into `store`, which has the scene's channels and the rate. Recordings must be read
/// (read_surfaces()). banks[i] belongs to scene.bodies[i], which is body i of the events (see EventPlayback). Bodies without events get no
/// effects.
Sound calc_sound(const scene::Scene& scene, const std::vector<const bank::Bank*>& banks, const scene::Events& events,
                 const RenderOptions& options, sound::SoundStore& store);

/// Warning about a deflection beyond the range of linear modes, else empty. `thicknesses`: Sound::body_deflection.
std::string describe_bending(const std::string& name, const bank::Bank& bank, double thicknesses);

/// Number of frames of a sound of this duration.
std::uint64_t count_frames(double duration_s, int rate_hz);

/// Gain of the output file [full scale per Pa]. A given gain that would clip is reduced to that of "auto".
struct Gain {
  double per_pa = 1.0;
  bool reduced = false;
};
Gain calc_gain(const scene::Output& output, double peak_pa);

}  // namespace carillon::render
