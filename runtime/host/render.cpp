// Method:     the bodies of the scene in a synthesiser, which is fed with what happens period by period; what it gives first, while the
//             sound is still in its ears' filters, is cut off.
// Source:     OCE01 (two receivers 20 cm apart or a list of them).
// Deviations: heads do not shade; the ground does not reflect.
#include "runtime/host/render.hpp"

#include <algorithm>
#include <cmath>
#include <ctime>
#include <limits>
#include <map>
#include <memory>
#include <numbers>
#include <numeric>
#include <optional>

#include "runtime/base/cpu_clock.hpp"
#include "runtime/host/feed.hpp"
#include "runtime/host/microphones.hpp"
#include "runtime/host/pose.hpp"
#include "runtime/radiation/gains.hpp"
#include "runtime/synth/cpu_ticks.hpp"
#include "runtime/synth/texture.hpp"

namespace carillon::host {
namespace {

using synth::Effect;

constexpr std::size_t kBlock = synth::kPeriod;
constexpr double kReferencePa = 20e-6;
constexpr double kFastS = 0.125;
constexpr double kFarthestHeardM = 15e3;  // what a body sends from further away is not heard (84 dB down, and memory has an end)
constexpr int kMostStrikes = 256;         // of a body, waiting or acting at once
constexpr int kMostForces = 512;          // of a body that gets any

double calc_distance(const Vec3& a, const Vec3& b) { return std::hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]); }

/// What the events say about one body.
struct BodyCourse {
  bool is_played = false;   // something happens to it
  bool is_touched = false;  // by a contact that lasts
  bool is_pushed = false;   // by forces known step by step
  stream::Motion first;     // where it is at the beginning
  double reach_m = 0.0;     // how far from the first microphone's place it ever gets
};

std::vector<BodyCourse> survey(const Scene& scene, const std::vector<const bank::Bank*>& banks, const Events& events, const Vec3& base) {
  std::vector<BodyCourse> courses(scene.bodies.size());
  std::vector<bool> is_placed(scene.bodies.size());
  const auto find = [&](std::int32_t body) { return body >= 0 && static_cast<std::size_t>(body) < courses.size(); };
  events.for_each([&](const stream::Event& event) {
    if (const auto* motion = std::get_if<stream::Motion>(&event); motion != nullptr && find(motion->body)) {
      const auto i = static_cast<std::size_t>(motion->body);
      if (!is_placed[i]) courses[i].first = *motion;
      if (!is_placed[i] || !scene.bodies[i].spec.fixed)
        courses[i].reach_m = std::max(courses[i].reach_m, calc_distance(motion->position_m, base));
      is_placed[i] = true;
    }
    if (const auto* impulse = std::get_if<stream::Impulse>(&event); impulse != nullptr && find(impulse->body))
      courses[static_cast<std::size_t>(impulse->body)].is_played = true;
    if (const auto* force = std::get_if<stream::Force>(&event); force != nullptr && find(force->body))
      courses[static_cast<std::size_t>(force->body)].is_played = courses[static_cast<std::size_t>(force->body)].is_pushed = true;
    if (const auto* contact = std::get_if<stream::Contact>(&event); contact != nullptr && find(contact->body))
      courses[static_cast<std::size_t>(contact->body)].is_played = courses[static_cast<std::size_t>(contact->body)].is_touched = true;
  });
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
  Changes(const Scene& scene, const std::vector<BodyCourse>& courses, const Plan* plan)
      : scene_(&scene), courses_(&courses), first_(courses.size(), scene.effects), all_(first_) {
    if (plan == nullptr) return;
    steps_.emplace(plan->steps);
    std::vector<bool> is_known(courses.size());
    plan->steps.for_each([&](const PlanStep& step) {
      const auto body = static_cast<std::size_t>(step.body);
      all_[body] = is_known[body] ? all_[body].with(step.effects) : step.effects;
      if (!is_known[body]) first_[body] = step.effects;
      is_known[body] = true;
    });
  }
  /// What a body begins with, and what it has at any time.
  synth::EffectSet find_first(std::size_t body) const { return find(body, first_[body]); }
  synth::EffectSet find_all(std::size_t body) const { return find(body, all_[body]); }
  void apply(double until_s, synth::Synthesiser& synthesiser) {
    if (!steps_) return;
    synthesiser.collect();
    for (const PlanStep* step = steps_->peek(); step != nullptr && step->time_s < until_s; step = steps_->peek()) {
      const synth::EffectSet effects = find(static_cast<std::size_t>(step->body), step->effects);
      if (effects != synthesiser.get_effects(step->body)) synthesiser.set_effects(step->body, effects);
      steps_->next();
    }
  }

 private:
  synth::EffectSet find(std::size_t body, synth::EffectSet effects) const {
    const BodyCourse& course = (*courses_)[body];
    if (!course.is_played) return {};
    if (!course.is_touched) effects = effects.without(synth::kContactEffects);
    return find_effects(*scene_, body, effects);
  }

  const Scene* scene_;
  const std::vector<BodyCourse>* courses_;
  std::vector<synth::EffectSet> first_, all_;  // per body
  std::optional<base::Records<PlanStep>::Reader> steps_;
};

/// What comes out of the synthesiser on its way into the store: measured, and with its end held back until it is known whether it has to
/// fade.
class Outlet {
 public:
  Outlet(SoundStore& store, std::uint64_t frames, bool fades)
      : store_(&store),
        meter_(store.get_rate_hz(), store.get_channels()),
        tail_begin_(fades ? frames - std::min<std::uint64_t>(frames, static_cast<std::uint64_t>(std::llround(kFadeS * store.get_rate_hz())))
                          : frames) {}

  /// The next frames, by channels.
  void add(const std::vector<const float*>& channels, std::size_t count) {
    for (std::size_t n = 0; n < count; ++n)
      for (const float* channel : channels) frames_.push_back(channel[n]);
    if (frames_.size() >= kHeld * channels.size()) pass_on();
  }
  void finish(Sound& sound) {
    pass_on();
    const auto peak = std::accumulate(tail_.begin(), tail_.end(), 0.0F, [](float most, float p) { return std::max(most, std::abs(p)); });
    const std::size_t channels = store_->get_channels(), count = tail_.size() / channels;
    if (peak > 0.0F && peak >= kFadeShare * std::max(meter_.get_peak_pa(), static_cast<double>(peak))) {
      for (std::size_t i = 0; i < tail_.size(); ++i) {
        const double c = std::cos(0.5 * std::numbers::pi * static_cast<double>(i / channels + 1) / static_cast<double>(count));
        tail_[i] = i / channels + 1 == count ? 0.0F : static_cast<float>(tail_[i] * c * c);
      }
      sound.faded_s = static_cast<double>(count) / store_->get_rate_hz();
    }
    store(tail_);
    sound.peak_pa = meter_.get_peak_pa();
    sound.levels = meter_.calc_levels();
    sound.frames = store_->get_frames();
  }
  /// CPU time of what is not playing: of measuring and storing, up to now.
  double get_seconds_cpu() const { return seconds_cpu_; }

 private:
  static constexpr std::size_t kHeld = 8192;  // frames: the clock is asked twice for so many

  void pass_on() {
    const double began = base::get_process_cpu_s();
    const std::size_t channels = store_->get_channels(), count = frames_.size() / channels;
    const auto before = static_cast<std::size_t>(std::min<std::uint64_t>(count, tail_begin_ - std::min(tail_begin_, taken_)));
    const std::span<const float> all(frames_);
    store(all.first(before * channels));
    const std::span<const float> rest = all.subspan(before * channels);
    tail_.insert(tail_.end(), rest.begin(), rest.end());
    taken_ += count;
    frames_.clear();
    seconds_cpu_ += base::get_process_cpu_s() - began;
  }
  void store(std::span<const float> frames) {
    meter_.add(frames);
    store_->append(frames);
  }

  SoundStore* store_;
  Meter meter_;
  std::uint64_t tail_begin_ = 0, taken_ = 0;
  std::vector<float> frames_, tail_;
  double seconds_cpu_ = 0.0;
};

/// Below which pressure at 1 m a body sleeps: where the planner is free to choose, what is inaudible.
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

Sound calc_sound(const Scene& scene, const std::vector<const bank::Bank*>& banks, const Events& events, const RenderOptions& options,
                 SoundStore& store) {
  const double started = base::get_process_cpu_s();
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
      double radius_m = clicks ? scene.bodies[i].sphere_radius_m : 0.0;
      if (clicks && radius_m == 0.0) radius_m = radiation::calc_sphere_radius_m(*banks[i]);
      model = synth::Model::make(*banks[i], {.rate_hz = rate_hz, .sphere_radius_m = radius_m});
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
  std::vector<double> longest_m, longest_s;
  for (const BodyCourse& course : courses) {
    longest_m.push_back(std::min(course.reach_m + ears_reach_m, kFarthestHeardM));
    longest_s.push_back(longest_m.back() / synth::kSoundSpeedMs);
  }
  const std::vector<int> waypoints = feed.count_waypoints(longest_s);
  synth::Synthesiser synthesiser({.rate_hz = rate_hz,
                                  .microphones_m = microphones.offset_m,
                                  .listener_m = base,
                                  .max_bodies = std::max(1, static_cast<int>(fed.size())),
                                  .max_strikes = kMostStrikes,
                                  .max_waypoints = waypoints.back(),
                                  .budget = calc_budget(scene.quality, rate_hz),
                                  .ground = make_ground(scene),
                                  .ticks = options.measures ? &synth::get_cpu_ticks : nullptr});
  for (std::size_t i = 0; i < fed.size(); ++i) {
    synthesiser.add_body(body_models[i], {.position_m = courses[i].first.position_m,
                                          .rotation = courses[i].first.rotation,
                                          .effects = changes.find_first(i),
                                          .silence_pa = find_silence_pa(scene, i, options.plan),
                                          .surface = make_surface(scene.bodies[i]),
                                          .longest_m = longest_m[i],
                                          .max_waypoints = waypoints[i],
                                          .max_forces = courses[i].is_pushed ? kMostForces : 0,
                                          .isa = scene.quality.instructions,
                                          .audits_energy = options.audits});
  }

  constexpr std::size_t kLatency = synth::Synthesiser::kLatency;
  const std::size_t samples = count_frames(scene.duration_s, options.rate_hz) + kLatency;
  const std::size_t channels = sound.channels = microphones.offset_m.size();
  Outlet outlet(store, samples - kLatency, options.fades_end);
  std::vector<const float*> heard(channels);
  std::vector<std::array<float, kBlock>> blocks(channels);
  std::vector<float*> out;
  for (auto& block : blocks) out.push_back(block.data());
  const double began = base::get_process_cpu_s();
  const std::uint64_t asked_ns = synth::get_cpu_ticks_cost_ns();
  for (std::size_t start = 0; start < samples; start += kBlock) {
    const std::size_t count = std::min(kBlock, samples - start);
    changes.apply(static_cast<double>(start + kBlock) / rate_hz, synthesiser);
    feed.hand_on(static_cast<double>(start + kBlock) / rate_hz, synthesiser);
    synthesiser.process(out.data(), static_cast<int>(channels), static_cast<int>(count));
    const std::size_t skipped = std::min(count, start < kLatency ? kLatency - start : 0);
    for (std::size_t c = 0; c < channels; ++c) heard[c] = blocks[c].data() + skipped;
    outlet.add(heard, count - skipped);
    if (options.progress) options.progress(static_cast<double>(start + count) / static_cast<double>(samples));
  }
  sound.seconds_playing_cpu = std::max(0.0, base::get_process_cpu_s() - began - outlet.get_seconds_cpu() -
                                                1e-9 * static_cast<double>(synth::get_cpu_ticks_cost_ns() - asked_ns));
  outlet.finish(sound);
  if (options.measures) sound.seconds_per_tick = 1e-9;
  const synth::SynthesiserCounters counters = synthesiser.get_counters();
  sound.strikes = counters.strikes;
  sound.refused = counters.refused + counters.faults + counters.overflows;
  sound.resets = counters.resets;
  for (std::size_t i = 0; i < fed.size(); ++i) {
    sound.body_peak_pa.push_back(synthesiser.get_peak_pa(static_cast<int>(i)));
    sound.energy_rise = std::max(sound.energy_rise, synthesiser.get_energy_rise(static_cast<int>(i)));
    sound.radiated_j += synthesiser.get_radiated_j(static_cast<int>(i));
    sound.effect_counters.push_back(synthesiser.get_effect_counters(static_cast<int>(i)));
  }
  sound.seconds_cpu = base::get_process_cpu_s() - started;
  return sound;
}

std::uint64_t count_frames(double duration_s, int rate_hz) { return static_cast<std::uint64_t>(std::llround(duration_s * rate_hz)); }

double calc_budget(const Quality& quality, double rate_hz) {
  return quality.modes ? static_cast<double>(*quality.modes) * rate_hz : std::numeric_limits<double>::infinity();
}

synth::EffectSet find_effects(const Scene& scene, std::size_t body, synth::EffectSet effects) {
  effects = effects.common(synth::kCompiledEffects);
  if (scene.bodies[body].spec.fixed) effects = effects.without(Effect::kAccelerationNoise);
  if (!scene.microphones_m.empty()) effects = effects.with(synth::EffectSet{Effect::kTwoEars}.common(synth::kCompiledEffects));
  return effects;
}

Meter::Meter(int rate_hz, std::size_t channels) : channels_(channels), window_(static_cast<std::size_t>(std::max(1.0, kFastS * rate_hz))) {}

void Meter::add(std::span<const float> frames) {
  for (std::size_t i = 0; i < frames.size(); i += channels_) {
    for (const float sample : frames.subspan(i, channels_)) {
      const auto p = static_cast<double>(sample);
      sum_ += p * p / static_cast<double>(channels_);
      peak_pa_ = std::max(peak_pa_, std::abs(p));
    }
    if (++frames_ % window_ != 0) continue;
    total_ += sum_;
    loudest_ = std::max(loudest_, sum_);
    sum_ = 0.0;
  }
}

Levels Meter::calc_levels() const {
  const auto to_db = [](double mean_square) { return 10.0 * std::log10(mean_square / (kReferencePa * kReferencePa)); };
  const double total = total_ + sum_, loudest = std::max(loudest_, sum_);
  return {.mean_db = to_db(frames_ > 0 ? total / static_cast<double>(frames_) : 0.0),
          .loudest_db = to_db(loudest / static_cast<double>(std::min<std::uint64_t>(window_, std::max<std::uint64_t>(frames_, 1))))};
}

Gain calc_gain(const Output& output, double peak_pa) {
  if (!(peak_pa > 0.0)) return {.per_pa = output.gain_per_pa.value_or(1.0), .reduced = false};
  const double automatic = std::pow(10.0, output.peak_dbfs / 20.0) / peak_pa;
  if (!output.gain_per_pa) return {.per_pa = automatic, .reduced = false};
  if (*output.gain_per_pa * peak_pa <= 1.0) return {.per_pa = *output.gain_per_pa, .reduced = false};
  return {.per_pa = automatic, .reduced = true};
}

}  // namespace carillon::host
