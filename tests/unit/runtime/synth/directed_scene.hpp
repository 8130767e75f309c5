// Scenes of directivity and ground reflection: one body, its events and microphones.
#pragma once

#include <algorithm>
#include <cmath>
#include <complex>
#include <functional>
#include <limits>
#include <numbers>
#include <optional>
#include <vector>

#include "runtime/synth/synthesiser.hpp"
#include "tests/unit/runtime/synth/cube_bank.hpp"
#include "tests/unit/runtime/synth/multipole_cube.hpp"

namespace carillon::testing {

using namespace synth;

using std::numbers::pi;
using Complex = std::complex<double>;
using Sound = std::vector<std::vector<float>>;
inline constexpr double kRate = 48000.0;
inline constexpr double kC = bank::kSoundSpeedMs;
inline constexpr int kStruck = 480;  // sample at which a body is struck
inline constexpr EffectSet kDirected = kDefaultEffects.with(Effect::kDirectivity);

/// One body with its position, events and microphones.
struct Scene {
  bank::Bank bank;
  std::vector<Vec3> microphones_m;
  EffectSet effects = kDirected;
  Vec3 position_m{};
  events::Quaternion rotation{1.0, 0.0, 0.0, 0.0};
  std::optional<Floor> floor = std::nullopt;
  std::vector<events::Event> events{};
  int frames = 4800, block = 128;
  double budget = std::numeric_limits<double>::infinity();
  Isa isa = Isa::kBest;
  std::function<void(Synthesiser&, int)> meddle = nullptr;  // called after half of the frames
};

inline Sound play(const Scene& scene, EffectCounters* counters = nullptr) {
  SynthesiserOptions options{.rate_hz = kRate, .microphones_m = scene.microphones_m, .max_waypoints = 4096, .ring_events = 16384};
  options.floor = scene.floor;
  options.budget = scene.budget;
  Synthesiser synthesiser(options);
  const int body =
      synthesiser.add_body(Model::make(scene.bank, {.rate_hz = kRate}),
                           {.position_m = scene.position_m, .rotation = scene.rotation, .effects = scene.effects, .isa = scene.isa});
  for (const auto& event : scene.events) synthesiser.push(event);
  Sound out(scene.microphones_m.size(), std::vector<float>(scene.frames));
  bool has_meddled = scene.meddle == nullptr;
  for (int done = 0; done < scene.frames;) {
    const int count = std::min(scene.block, scene.frames - done);
    std::vector<float*> at;
    for (auto& channel : out) at.push_back(channel.data() + done);
    synthesiser.process(at.data(), static_cast<int>(at.size()), count);
    done += count;
    synthesiser.collect();
    if (!has_meddled && 2 * done >= scene.frames) {
      scene.meddle(synthesiser, body);
      has_meddled = true;
    }
  }
  if (counters != nullptr) *counters = synthesiser.get_effect_counters(body);
  return out;
}

inline events::Impulse make_blow(double duration_s = 0.0, int sample = kStruck) {
  return {.time_s = sample / kRate, .body = 0, .impulse_n_s = {0.0, 0.0, 1.0}, .duration_s = duration_s};
}

/// Undamped mode after a strike, velocity cos(omega t).
inline Scene make_tone(double freq_hz, const ModeMultipoles& multipoles, double radius_m, std::vector<Vec3> microphones_m) {
  Scene scene{.bank = make_cube_bank({{freq_hz, 0.0}}), .microphones_m = std::move(microphones_m), .events = {make_blow()}};
  give_multipoles(scene.bank, {multipoles}, radius_m);
  return scene;
}

/// Amplitude of a steady tone, times e^{i phase} of its cosine since the strike and the latency, by least squares.
inline Complex measure(const std::vector<float>& sound, double freq_hz, std::size_t from = 2400) {
  double cc = 0.0, cs = 0.0, ss = 0.0, pc = 0.0, ps = 0.0;
  for (std::size_t n = from; n < sound.size(); ++n) {
    const double angle = 2.0 * pi * freq_hz * (static_cast<double>(n) - kStruck - Synthesiser::kLatency) / kRate;
    const double c = std::cos(angle), s = std::sin(angle), p = static_cast<double>(sound[n]);
    cc += c * c, cs += c * s, ss += s * s, pc += p * c, ps += p * s;
  }
  const double det = cc * ss - cs * cs;
  return {(pc * ss - ps * cs) / det, -(ps * cc - pc * cs) / det};  // Re(X e^{i angle}) = Re X cos - Im X sin
}

inline double calc_rms(const std::vector<float>& x, std::size_t from = 0) {
  double sum = 0.0;
  for (std::size_t n = from; n < x.size(); ++n) sum += static_cast<double>(x[n]) * static_cast<double>(x[n]);
  return std::sqrt(sum / static_cast<double>(x.size() - from));
}

inline double calc_difference_db(const std::vector<float>& x, const std::vector<float>& reference, std::size_t from = 0) {
  std::vector<float> rest(x.size());
  for (std::size_t n = 0; n < x.size(); ++n) rest[n] = x[n] - reference[n];
  return 20.0 * std::log10(calc_rms(rest, from) / calc_rms(reference, from) + 1e-30);
}

inline double to_db(double x) { return 20.0 * std::log10(x + 1e-30); }

inline events::Quaternion turn_about(const Vec3& axis, double angle) {
  const double s = std::sin(0.5 * angle);
  return {std::cos(0.5 * angle), s * axis[0], s * axis[1], s * axis[2]};
}

/// Many modes, some over-damped, whose transfers are their gains over the distance: a sphere so small that all is real.
inline Scene make_gains_scene() {
  std::vector<InventedMode> modes = make_many_modes(60);
  for (std::size_t m = 0; m < modes.size(); m += 20) modes[m].decay_per_s = 3.0 * 2.0 * pi * modes[m].freq_hz;
  for (std::size_t m = 0; m < modes.size(); ++m) modes[m].gain = 1e-2 * (m % 3 == 0 ? -1.0 : 1.0) / (1.0 + 0.1 * static_cast<double>(m));
  Scene scene{.bank = make_cube_bank(modes), .microphones_m = {{0.0, 1.0, 0.0}, {0.5, 1.2, 0.0}}, .frames = 9600};
  std::vector<ModeMultipoles> multipoles;
  constexpr double kRadius = 1e-6;
  for (const auto& mode : modes) multipoles.push_back({mode.gain / kRadius * std::sqrt(4.0 * pi)});
  give_multipoles(scene.bank, multipoles, kRadius);
  for (int i = 0; i < 12; ++i) scene.events.emplace_back(make_blow(i % 2 == 0 ? 0.0 : 1.1e-3, kStruck + 413 * i));
  return scene;
}

}  // namespace carillon::testing
