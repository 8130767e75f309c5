// Method:     each impulse of the simulation strikes the modes of its body; each body is heard at both ears from its centre of mass.
// Source:     OSG02 (contact pulses to modes), OCE01 (two receivers 20 cm apart, delay and 1 / r).
// Deviations: heads do not shade; the ground does not reflect.
#include "runtime/host/render.hpp"

#include <algorithm>
#include <cmath>
#include <ctime>
#include <memory>

#include "runtime/host/pose.hpp"
#include "runtime/synth/modal_body.hpp"
#include "runtime/synth/propagation.hpp"

namespace carillon::host {
namespace {

constexpr std::size_t kBlock = 512;
constexpr double kReferencePa = 20e-6;
constexpr double kFastS = 0.125;
constexpr double kFarthestHeardM = 15e3;  // what a body sends from further away is not heard (84 dB down, and memory has an end)

double get_cpu_seconds() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

synth::Path make_path(const std::vector<contact::Pose>& poses, const bank::Bank& bank, const contact::BodySpec& spec) {
  std::vector<synth::Path::Point> points;
  const auto add = [&](const contact::Pose& pose) { points.push_back({pose.time_s, calc_world_point(pose, bank.rigid.centre_m)}); };
  if (spec.fixed || poses.empty()) {
    add(poses.empty() ? spec.initial : poses.front());
  } else {
    for (const contact::Pose& pose : poses) add(pose);
  }
  return synth::Path(std::move(points));
}

/// One body with its way to both ears, and the impulses still to come.
struct Voice {
  synth::ModalBody body;
  synth::Path path;
  std::vector<synth::Propagation> to_ear;
  std::vector<synth::Strike> strikes;  // in order of their beginning
  std::size_t next = 0;

  Voice(const bank::Bank& bank, int rate_hz, synth::Path way) : body(bank, rate_hz), path(std::move(way)) {}
  double get_begin(std::size_t i, double rate_hz) const { return strikes[i].sample - 0.5 * strikes[i].duration_s * rate_hz; }
};

double calc_longest_m(const std::vector<contact::Pose>& poses, const contact::BodySpec& spec, const bank::Bank& bank, const Vec3& ear) {
  double longest = 0.0;
  const auto visit = [&](const contact::Pose& pose) {
    const contact::Vec3 x = calc_world_point(pose, bank.rigid.centre_m);
    longest = std::max(longest, std::hypot(x[0] - ear[0], x[1] - ear[1], x[2] - ear[2]));
  };
  visit(spec.initial);
  for (const contact::Pose& pose : poses) visit(pose);
  return std::min(longest + 1.0, kFarthestHeardM);
}

std::vector<std::unique_ptr<Voice>> make_voices(const Scene& scene, const std::vector<const bank::Bank*>& banks,
                                                const contact::Simulation& simulation, int rate_hz) {
  const std::array<Vec3, 2> ears = calc_ears(scene.listener);
  std::vector<std::unique_ptr<Voice>> voices;
  const std::vector<contact::Pose> none;
  for (std::size_t i = 0; i < scene.bodies.size(); ++i) {
    const contact::BodySpec& spec = scene.bodies[i].spec;
    const std::vector<contact::Pose>& poses = i < simulation.poses.size() ? simulation.poses[i] : none;
    voices.push_back(std::make_unique<Voice>(*banks[i], rate_hz, make_path(poses, *banks[i], spec)));
    for (const Vec3& ear : ears) {
      voices.back()->to_ear.emplace_back(voices.back()->path, ear, rate_hz, calc_longest_m(poses, spec, *banks[i], ear));
    }
  }
  for (const contact::Impulse& impulse : simulation.impulses) {
    if (impulse.body < 0 || static_cast<std::size_t>(impulse.body) >= voices.size()) continue;
    voices[static_cast<std::size_t>(impulse.body)]->strikes.push_back({.sample = impulse.time_s * rate_hz,
                                                                       .duration_s = impulse.duration_s,
                                                                       .triangle = impulse.triangle,
                                                                       .barycentric = impulse.barycentric,
                                                                       .impulse_n_s = impulse.impulse_n_s});
  }
  for (auto& voice : voices) {
    std::stable_sort(voice->strikes.begin(), voice->strikes.end(), [rate_hz](const synth::Strike& a, const synth::Strike& b) {
      return a.sample - 0.5 * a.duration_s * rate_hz < b.sample - 0.5 * b.duration_s * rate_hz;
    });
  }
  return voices;
}

}  // namespace

Sound calc_sound(const Scene& scene, const std::vector<const bank::Bank*>& banks, const contact::Simulation& simulation, int rate_hz,
                 const std::function<void(double)>& progress) {
  const double started = get_cpu_seconds();
  std::vector<std::unique_ptr<Voice>> voices = make_voices(scene, banks, simulation, rate_hz);
  const auto samples = static_cast<std::size_t>(std::llround(scene.duration_s * rate_hz));
  constexpr std::size_t kLatency = synth::Propagation::kLatency;

  Sound sound;
  sound.rate_hz = rate_hz;
  sound.body_peak_pa.assign(voices.size(), 0.0);
  for (auto& ear : sound.pressure_pa) ear.assign(samples + kLatency, 0.0);
  std::vector<double> pressure(kBlock);
  for (std::size_t start = 0; start < samples + kLatency; start += kBlock) {
    const std::size_t count = std::min(kBlock, samples + kLatency - start);
    for (std::size_t i = 0; i < voices.size(); ++i) {
      Voice& voice = *voices[i];
      while (voice.next < voice.strikes.size() && voice.get_begin(voice.next, rate_hz) < static_cast<double>(start + count)) {
        voice.body.strike(voice.strikes[voice.next++]);
      }
      std::fill(pressure.begin(), pressure.end(), 0.0);
      voice.body.process(std::span(pressure).first(count));
      for (const double p : std::span(pressure).first(count)) sound.body_peak_pa[i] = std::max(sound.body_peak_pa[i], std::abs(p));
      for (std::size_t ear = 0; ear < 2; ++ear) {
        voice.to_ear[ear].process(std::span<const double>(pressure).first(count), std::span(sound.pressure_pa[ear]).subspan(start, count));
      }
    }
    if (progress) progress(static_cast<double>(start + count) / static_cast<double>(samples + kLatency));
  }
  for (auto& ear : sound.pressure_pa) ear.erase(ear.begin(), ear.begin() + static_cast<std::ptrdiff_t>(kLatency));
  for (const auto& voice : voices) {
    sound.modes += voice->body.get_mode_count();
    sound.body_modes.push_back(voice->body.get_mode_count());
    sound.strikes += voice->body.get_counters().accepted;
    sound.refused += voice->body.get_counters().refused;
    sound.resets += voice->body.get_counters().resets;
  }
  sound.seconds_cpu = get_cpu_seconds() - started;
  return sound;
}

double calc_peak_pa(const Sound& sound) {
  double peak = 0.0;
  for (const auto& ear : sound.pressure_pa) {
    for (const double p : ear) peak = std::max(peak, std::abs(p));
  }
  return peak;
}

Levels calc_levels(const Sound& sound) {
  const auto window = static_cast<std::size_t>(std::max(1.0, kFastS * sound.rate_hz));
  const std::size_t samples = sound.pressure_pa[0].size();
  double total = 0.0, loudest = 0.0;
  for (std::size_t start = 0; start < samples; start += window) {
    double sum = 0.0;
    for (std::size_t n = start; n < std::min(samples, start + window); ++n) {
      sum += 0.5 * (sound.pressure_pa[0][n] * sound.pressure_pa[0][n] + sound.pressure_pa[1][n] * sound.pressure_pa[1][n]);
    }
    total += sum;
    loudest = std::max(loudest, sum);
  }
  const auto to_db = [](double mean_square) { return 10.0 * std::log10(mean_square / (kReferencePa * kReferencePa)); };
  return {.mean_db = to_db(samples > 0 ? total / static_cast<double>(samples) : 0.0),
          .loudest_db = to_db(loudest / static_cast<double>(std::min(window, std::max<std::size_t>(samples, 1))))};
}

Gain calc_gain(const Output& output, double peak_pa) {
  if (!(peak_pa > 0.0)) return {.per_pa = output.gain_per_pa.value_or(1.0), .reduced = false};
  const double automatic = std::pow(10.0, output.peak_dbfs / 20.0) / peak_pa;
  if (!output.gain_per_pa) return {.per_pa = automatic, .reduced = false};
  if (*output.gain_per_pa * peak_pa <= 1.0) return {.per_pa = *output.gain_per_pa, .reduced = false};
  return {.per_pa = automatic, .reduced = true};
}

}  // namespace carillon::host
