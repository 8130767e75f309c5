// Method:     the bodies of the scene in a synthesiser, which is fed with what happens period by period; what it gives first, while the
//             sound is still in its ears' filters, is cut off.
// Source:     OCE01 (two receivers 20 cm apart or a list of them).
// Deviations: heads do not shade; the ground does not reflect.
#include "runtime/host/render.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <ctime>
#include <limits>
#include <map>
#include <memory>

#include "runtime/host/feed.hpp"
#include "runtime/host/microphones.hpp"
#include "runtime/host/pose.hpp"
#include "runtime/radiation/gains.hpp"
#include "runtime/synth/texture.hpp"

namespace carillon::host {
namespace {

using synth::Effect;

constexpr std::size_t kBlock = synth::kPeriod;
constexpr double kReferencePa = 20e-6;
constexpr double kFastS = 0.125;
constexpr double kFarthestHeardM = 15e3;  // what a body sends from further away is not heard (84 dB down, and memory has an end)
constexpr int kMostStrikes = 256;         // of a body, waiting or acting at once

double get_cpu_seconds() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

std::uint64_t get_ticks() noexcept {
#if defined(__x86_64__)
  return __builtin_ia32_rdtsc();
#else
  return static_cast<std::uint64_t>(std::chrono::steady_clock::now().time_since_epoch().count());
#endif
}

double calc_distance(const Vec3& a, const Vec3& b) { return std::hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]); }

/// What the events say about one body.
struct BodyCourse {
  bool is_played = false;   // something happens to it
  bool is_touched = false;  // by a contact that lasts
  stream::Motion first;     // where it is at the beginning
  double reach_m = 0.0;     // how far from the first microphone's place it ever gets
};

std::vector<BodyCourse> survey(const Scene& scene, const std::vector<const bank::Bank*>& banks, std::span<const stream::Event> events,
                               const Vec3& base) {
  std::vector<BodyCourse> courses(scene.bodies.size());
  std::vector<bool> is_placed(scene.bodies.size());
  const auto find = [&](std::int32_t body) { return body >= 0 && static_cast<std::size_t>(body) < courses.size(); };
  for (const stream::Event& event : events) {
    if (const auto* motion = std::get_if<stream::Motion>(&event); motion != nullptr && find(motion->body)) {
      const auto i = static_cast<std::size_t>(motion->body);
      if (!is_placed[i]) courses[i].first = *motion;
      if (!is_placed[i] || !scene.bodies[i].spec.fixed)
        courses[i].reach_m = std::max(courses[i].reach_m, calc_distance(motion->position_m, base));
      is_placed[i] = true;
    }
    if (const auto* impulse = std::get_if<stream::Impulse>(&event); impulse != nullptr && find(impulse->body))
      courses[static_cast<std::size_t>(impulse->body)].is_played = true;
    if (const auto* contact = std::get_if<stream::Contact>(&event); contact != nullptr && find(contact->body))
      courses[static_cast<std::size_t>(contact->body)].is_played = courses[static_cast<std::size_t>(contact->body)].is_touched = true;
  }
  for (std::size_t i = 0; i < courses.size(); ++i) {
    if (is_placed[i]) continue;
    const contact::Pose& initial = scene.bodies[i].spec.initial;
    courses[i].first.position_m = calc_world_point(initial, banks[i]->rigid.centre_m);
    courses[i].first.rotation = initial.rotation;
    courses[i].reach_m = calc_distance(courses[i].first.position_m, base);
  }
  return courses;
}

/// The changes of a plan, made when their time has come. A body to which nothing happens has no effects, one that no contact touches for
/// long none of those of contacts.
class Changes {
 public:
  Changes(const Scene& scene, const std::vector<BodyCourse>& courses, const Plan* plan) : scene_(&scene), courses_(&courses) {
    if (plan != nullptr) changes_ = plan->changes;
  }
  /// What a body begins with, and what it has at any time.
  synth::EffectSet find_first(std::size_t body) const {
    const auto first = std::find_if(changes_.begin(), changes_.end(), [&](const auto& change) { return is_of(change, body); });
    return find(body, first == changes_.end() ? scene_->effects : first->effects);
  }
  synth::EffectSet find_all(std::size_t body) const {
    synth::EffectSet all = find_first(body);
    for (const plan::Change& change : changes_)
      if (is_of(change, body)) all = all.with(find(body, change.effects));
    return all;
  }
  void apply(double until_s, synth::Synthesiser& synthesiser) {
    if (changes_.empty()) return;
    synthesiser.collect();
    for (; next_ < changes_.size() && changes_[next_].time_s < until_s; ++next_) {
      const int body = changes_[next_].body;
      const synth::EffectSet effects = find(static_cast<std::size_t>(body), changes_[next_].effects);
      if (effects != synthesiser.get_effects(body)) synthesiser.set_effects(body, effects);
    }
  }

 private:
  static bool is_of(const plan::Change& change, std::size_t body) { return static_cast<std::size_t>(change.body) == body; }
  synth::EffectSet find(std::size_t body, synth::EffectSet effects) const {
    const BodyCourse& course = (*courses_)[body];
    if (!course.is_played) return {};
    if (!course.is_touched) effects = effects.without(synth::kContactEffects);
    return find_effects(*scene_, body, effects);
  }

  const Scene* scene_;
  const std::vector<BodyCourse>* courses_;
  std::span<const plan::Change> changes_;
  std::size_t next_ = 0;
};

/// Below which pressure at 1 m a body sleeps: where the planner is free to say so, what nobody hears.
double find_silence_pa(const Scene& scene, std::size_t body, const Plan* plan) {
  if (scene.quality.silence_pa) return *scene.quality.silence_pa;
  const bool is_planned = plan != nullptr && scene.bodies[body].wish.automatic && !scene.bodies[body].wish.on.has(Effect::kModal);
  return is_planned ? plan->planner.calc_silence_pa(static_cast<int>(body)) : synth::BodySettings{}.silence_pa;
}

/// How far the microphones ever get from where the first of them starts.
double calc_reach_m(const Scene& scene, const Microphones& microphones, const Vec3& base) {
  double walk = 0.0, offset = 0.0;
  for (const synth::Place& place : scene.listener.path) walk = std::max(walk, calc_distance(place.position_m, base));
  for (const Vec3& x : microphones.offset_m) offset = std::max(offset, std::hypot(x[0], x[1], x[2]));
  return walk + offset + 1.0;
}

}  // namespace

Sound calc_sound(const Scene& scene, const std::vector<const bank::Bank*>& banks, std::span<const stream::Event> events,
                 const RenderOptions& options) {
  const double started = get_cpu_seconds();
  const Microphones microphones = make_microphones(scene);
  const std::vector<stream::Listener> walk = list_walk(microphones);
  const Vec3 base = microphones.centre.find(0.0).position_m;
  const double ears_reach_m = calc_reach_m(scene, microphones, base);
  const std::vector<BodyCourse> courses = survey(scene, banks, events, base);
  const auto rate_hz = static_cast<double>(options.rate_hz);

  Sound sound;
  sound.rate_hz = options.rate_hz;
  Changes changes(scene, courses, options.plan);
  std::vector<FedBody> fed(scene.bodies.size());
  std::map<const bank::Bank*, std::shared_ptr<const synth::Model>> models;  // bodies of the same bank share its tables
  std::vector<std::shared_ptr<const synth::Model>> body_models;
  for (std::size_t i = 0; i < fed.size(); ++i) {
    const synth::EffectSet effects = changes.find_all(i);
    sound.body_effects.push_back(effects);
    std::shared_ptr<const synth::Model>& model = models[banks[i]];
    if (!model) {
      const bool clicks = options.plan != nullptr || scene.effects.has(Effect::kAccelerationNoise);
      model =
          synth::Model::make(*banks[i], {.rate_hz = rate_hz, .sphere_radius_m = clicks ? radiation::calc_sphere_radius_m(*banks[i]) : 0.0});
    }
    body_models.push_back(model);
    sound.body_modes.push_back(model->get_mode_count());
    sound.modes += model->get_mode_count();
    // Once a process, and not while the sound plays.
    if (effects.has_any(synth::kContactEffects)) synth::Texture::make_tables();
    const double lead_s = effects.has(Effect::kAccelerationNoise) ? model->get_sphere_radius_m() / synth::kSoundSpeedMs : 0.0;
    fed[i] = {.number = static_cast<int>(i), .moves = !effects.is_empty() && !scene.bodies[i].spec.fixed, .lead_s = lead_s};
  }
  Feed feed(events, fed, walk);
  synth::Synthesiser synthesiser({.rate_hz = rate_hz,
                                  .microphones_m = microphones.offset_m,
                                  .listener_m = base,
                                  .max_bodies = std::max(1, static_cast<int>(fed.size())),
                                  .max_strikes = kMostStrikes,
                                  .max_waypoints = feed.count_waypoints(-1, 0.0),
                                  .budget = calc_budget(scene.quality, rate_hz),
                                  .ground = make_ground(scene),
                                  .ticks = options.measures ? &get_ticks : nullptr});
  for (std::size_t i = 0; i < fed.size(); ++i) {
    const double longest_m = std::min(courses[i].reach_m + ears_reach_m, kFarthestHeardM);
    synthesiser.add_body(body_models[i], {.position_m = courses[i].first.position_m,
                                          .rotation = courses[i].first.rotation,
                                          .effects = changes.find_first(i),
                                          .silence_pa = find_silence_pa(scene, i, options.plan),
                                          .surface = make_surface(scene.bodies[i]),
                                          .longest_m = longest_m,
                                          .max_waypoints = feed.count_waypoints(static_cast<int>(i), longest_m / synth::kSoundSpeedMs),
                                          .isa = scene.quality.instructions,
                                          .audits_energy = options.audits});
  }

  constexpr std::size_t kLatency = synth::Synthesiser::kLatency;
  const std::size_t samples = static_cast<std::size_t>(std::llround(scene.duration_s * rate_hz)) + kLatency;
  const std::size_t channels = microphones.offset_m.size();
  sound.pressure_pa.assign(channels, std::vector<double>(samples - kLatency));
  std::vector<std::array<float, kBlock>> blocks(channels);
  std::vector<float*> out;
  for (auto& block : blocks) out.push_back(block.data());
  const double began = get_cpu_seconds();
  const auto first_tick = get_ticks();
  const auto first_time = std::chrono::steady_clock::now();
  for (std::size_t start = 0; start < samples; start += kBlock) {
    const std::size_t count = std::min(kBlock, samples - start);
    changes.apply(static_cast<double>(start + kBlock) / rate_hz, synthesiser);
    feed.hand_on(static_cast<double>(start + kBlock) / rate_hz, synthesiser);
    synthesiser.process(out.data(), static_cast<int>(channels), static_cast<int>(count));
    for (std::size_t c = 0; c < channels; ++c) {
      for (std::size_t n = start < kLatency ? kLatency - start : 0; n < count; ++n)
        sound.pressure_pa[c][start + n - kLatency] = static_cast<double>(blocks[c][n]);
    }
    if (options.progress) options.progress(static_cast<double>(start + count) / static_cast<double>(samples));
  }
  sound.seconds_playing_cpu = get_cpu_seconds() - began;
  if (options.measures) {
    const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - first_time;
    sound.seconds_per_tick = seconds.count() / std::max(1.0, static_cast<double>(get_ticks() - first_tick));
  }
  const synth::SynthesiserCounters counters = synthesiser.get_counters();
  sound.strikes = counters.strikes;
  sound.refused = counters.refused + counters.faults + counters.overflows;
  sound.resets = counters.resets;
  for (std::size_t i = 0; i < fed.size(); ++i) {
    sound.body_peak_pa.push_back(synthesiser.get_peak_pa(static_cast<int>(i)));
    sound.energy_rise = std::max(sound.energy_rise, synthesiser.get_energy_rise(static_cast<int>(i)));
    sound.effect_counters.push_back(synthesiser.get_effect_counters(static_cast<int>(i)));
  }
  sound.seconds_cpu = get_cpu_seconds() - started;
  return sound;
}

double calc_budget(const Quality& quality, double rate_hz) {
  return quality.modes ? static_cast<double>(*quality.modes) * rate_hz : std::numeric_limits<double>::infinity();
}

synth::EffectSet find_effects(const Scene& scene, std::size_t body, synth::EffectSet effects) {
  effects = effects.common(synth::kCompiledEffects);
  if (scene.bodies[body].spec.fixed) effects = effects.without(Effect::kAccelerationNoise);
  if (!scene.microphones_m.empty()) effects = effects.with(synth::EffectSet{Effect::kTwoEars}.common(synth::kCompiledEffects));
  return effects;
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
