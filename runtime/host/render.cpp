// Method:     each impulse of the simulation strikes the modes of its body; each body is heard at every microphone from its centre of mass.
// Source:     OSG02 (contact pulses to modes), OCE01 (two receivers 20 cm apart or a list of them, delay and 1 / r).
// Deviations: heads do not shade; the ground does not reflect.
#include "runtime/host/render.hpp"

#include <algorithm>
#include <cmath>
#include <ctime>
#include <map>
#include <memory>

#include "runtime/host/microphones.hpp"
#include "runtime/host/pose.hpp"
#include "runtime/radiation/gains.hpp"
#include "runtime/synth/click.hpp"
#include "runtime/synth/ears.hpp"
#include "runtime/synth/voice.hpp"

namespace carillon::host {
namespace {

using synth::Effect;

constexpr std::size_t kBlock = 512;
constexpr double kReferencePa = 20e-6;
constexpr double kFastS = 0.125;
constexpr double kFarthestHeardM = 15e3;  // what a body sends from further away is not heard (84 dB down, and memory has an end)

double get_cpu_seconds() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

synth::Track make_path(const std::vector<contact::Pose>& poses, const bank::Bank& bank, const contact::BodySpec& spec) {
  std::vector<synth::Place> places;
  const auto add = [&](const contact::Pose& pose) { places.push_back({pose.time_s, calc_world_point(pose, bank.rigid.centre_m)}); };
  if (spec.fixed || poses.empty()) {
    add(poses.empty() ? spec.initial : poses.front());
  } else {
    for (const contact::Pose& pose : poses) add(pose);
  }
  return synth::make_track(places);
}

/// The acceleration noise of one body: three dipoles, along x, y and z of the world.
struct Clicks {
  synth::Click click;
  std::array<synth::History, 3> sent;
  std::array<std::array<float, kBlock>, 3> block{};
  std::size_t next = 0;

  Clicks(const bank::Bank& bank, int rate_hz, double longest_m)
      : click(radiation::calc_sphere_radius_m(bank), bank.rigid.mass_kg, rate_hz),
        sent{synth::History(longest_m, rate_hz, kBlock), synth::History(longest_m, rate_hz, kBlock),
             synth::History(longest_m, rate_hz, kBlock)} {}
};

/// One body with its way to every microphone, and the impulses still to come.
struct Source {
  synth::Voice voice;
  synth::Track path;
  synth::History sent;
  std::unique_ptr<Clicks> clicks;  // none when the effect is off or nothing can move the body
  std::vector<synth::Ear> ears;
  std::span<const contact::Pose> poses;
  std::vector<stream::Impulse> strikes;  // in order of their beginning
  std::size_t next = 0;

  Source(std::shared_ptr<const synth::Model> model, int rate_hz, synth::Track way, double longest_m)
      : voice(std::move(model)), path(std::move(way)), sent(longest_m, rate_hz, kBlock) {}
};

double get_begin_s(const stream::Impulse& impulse) {
  return impulse.time_s - 0.5 * synth::calc_pulse_length(impulse.shape, impulse.duration_s);
}

/// No less than the longest way from a body to a microphone: both as far as they ever get from where the first microphone starts.
double calc_longest_m(const std::vector<contact::Pose>& poses, const contact::BodySpec& spec, const bank::Bank& bank, const Scene& scene,
                      const Microphones& microphones) {
  const Vec3 base = microphones.centre.find(0.0).position_m;
  const auto calc_distance = [&base](const Vec3& x) { return std::hypot(x[0] - base[0], x[1] - base[1], x[2] - base[2]); };
  double body = calc_distance(calc_world_point(spec.initial, bank.rigid.centre_m)), walk = 0.0, reach = 0.0;
  for (const contact::Pose& pose : poses) body = std::max(body, calc_distance(calc_world_point(pose, bank.rigid.centre_m)));
  for (const synth::Place& place : scene.listener.path) walk = std::max(walk, calc_distance(place.position_m));
  for (const Vec3& offset : microphones.offset_m) reach = std::max(reach, std::hypot(offset[0], offset[1], offset[2]));
  return std::min(body + walk + reach + 1.0, kFarthestHeardM);
}

/// Plays the clicks that begin before `end` [samples] and pushes the next `count` samples.
void process_clicks(Source& source, const contact::Pose& initial, double rate_hz, double end, std::size_t count) {
  Clicks& clicks = *source.clicks;
  while (clicks.next < source.strikes.size()) {
    const stream::Impulse& strike = source.strikes[clicks.next];
    if ((get_begin_s(strike) - clicks.click.get_lead_s()) * rate_hz >= end) break;
    clicks.click.strike(strike, source.poses.empty() ? initial.rotation : find_pose(source.poses, strike.time_s).rotation);
    ++clicks.next;
  }
  std::array<std::span<float>, 3> dipole;
  for (std::size_t k = 0; k < 3; ++k) dipole[k] = std::span(clicks.block[k]).first(count);
  clicks.click.process(dipole);
  for (std::size_t k = 0; k < 3; ++k) clicks.sent[k].push(dipole[k]);
}

std::vector<std::unique_ptr<Source>> make_sources(const Scene& scene, const std::vector<const bank::Bank*>& banks,
                                                  const contact::Simulation& simulation, const Microphones& microphones, int rate_hz) {
  std::vector<std::unique_ptr<Source>> sources;
  std::map<const bank::Bank*, std::shared_ptr<const synth::Model>> models;  // bodies of the same bank share its tables
  const std::vector<contact::Pose> none;
  for (std::size_t i = 0; i < scene.bodies.size(); ++i) {
    const contact::BodySpec& spec = scene.bodies[i].spec;
    const std::vector<contact::Pose>& poses = i < simulation.poses.size() ? simulation.poses[i] : none;
    std::shared_ptr<const synth::Model>& model = models[banks[i]];
    if (!model) model = synth::Model::make(*banks[i], {.rate_hz = static_cast<double>(rate_hz)});
    const double longest = calc_longest_m(poses, spec, *banks[i], scene, microphones);
    sources.push_back(std::make_unique<Source>(model, rate_hz, make_path(poses, *banks[i], spec), longest));
    if (scene.effects.has(Effect::kAccelerationNoise) && !spec.fixed) {
      sources.back()->poses = poses;
      sources.back()->clicks = std::make_unique<Clicks>(*banks[i], rate_hz, longest);
    }
    for (const Vec3& offset : microphones.offset_m) sources.back()->ears.emplace_back(offset, rate_hz, scene.effects);
  }
  for (const contact::Impulse& impulse : simulation.impulses) {
    if (impulse.body < 0 || static_cast<std::size_t>(impulse.body) >= sources.size()) continue;
    std::vector<stream::Impulse>& strikes = sources[static_cast<std::size_t>(impulse.body)]->strikes;
    strikes.push_back(impulse);
    if (!scene.effects.has(Effect::kHertzPulse)) strikes.back().duration_s = 0.0;
  }
  for (auto& source : sources) {
    std::stable_sort(source->strikes.begin(), source->strikes.end(),
                     [](const stream::Impulse& a, const stream::Impulse& b) { return get_begin_s(a) < get_begin_s(b); });
  }
  return sources;
}

}  // namespace

Sound calc_sound(const Scene& scene, const std::vector<const bank::Bank*>& banks, const contact::Simulation& simulation, int rate_hz,
                 const std::function<void(double)>& progress) {
  const double started = get_cpu_seconds();
  const Microphones microphones = make_microphones(scene);
  std::vector<std::unique_ptr<Source>> sources = make_sources(scene, banks, simulation, microphones, rate_hz);
  const auto samples = static_cast<std::size_t>(std::llround(scene.duration_s * rate_hz));
  constexpr std::size_t kLatency = synth::Ear::kLatency;

  Sound sound;
  sound.rate_hz = rate_hz;
  sound.body_peak_pa.assign(sources.size(), 0.0);
  sound.pressure_pa.assign(microphones.offset_m.size(), std::vector<double>(samples + kLatency, 0.0));
  std::array<float, kBlock> block{};
  for (std::size_t start = 0; start < samples + kLatency; start += kBlock) {
    const std::size_t count = std::min(kBlock, samples + kLatency - start);
    const std::span<float> pressure = std::span(block).first(count);
    for (std::size_t i = 0; i < sources.size(); ++i) {
      Source& source = *sources[i];
      while (source.next < source.strikes.size() &&
             get_begin_s(source.strikes[source.next]) * rate_hz < static_cast<double>(start + count)) {
        if (scene.effects.has(Effect::kModal)) source.voice.strike(source.strikes[source.next]);
        ++source.next;
      }
      block.fill(0.0F);
      source.voice.process(pressure);
      for (const float p : pressure) sound.body_peak_pa[i] = std::max(sound.body_peak_pa[i], static_cast<double>(std::abs(p)));
      source.sent.push(pressure);
      synth::Source heard{.track = &source.path, .monopole = &source.sent};
      if (source.clicks) {
        process_clicks(source, scene.bodies[i].spec.initial, rate_hz, static_cast<double>(start + count), count);
        for (std::size_t k = 0; k < 3; ++k) heard.dipole[k] = &source.clicks->sent[k];
      }
      for (std::size_t ear = 0; ear < source.ears.size(); ++ear) {
        source.ears[ear].process(heard, microphones.centre, static_cast<std::int64_t>(start),
                                 std::span(sound.pressure_pa[ear]).subspan(start, count));
      }
    }
    if (progress) progress(static_cast<double>(start + count) / static_cast<double>(samples + kLatency));
  }
  for (auto& ear : sound.pressure_pa) ear.erase(ear.begin(), ear.begin() + static_cast<std::ptrdiff_t>(kLatency));
  for (const auto& source : sources) {
    const synth::VoiceCounters& counters = source->voice.get_counters();
    sound.modes += source->voice.get_model().get_mode_count();
    sound.body_modes.push_back(source->voice.get_model().get_mode_count());
    sound.strikes += counters.accepted;
    sound.refused += counters.refused + (source->clicks ? source->clicks->click.get_refused() : 0);
    sound.resets += counters.resets;
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
      for (const auto& channel : sound.pressure_pa) sum += channel[n] * channel[n] / static_cast<double>(sound.pressure_pa.size());
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
