// Method: a synthesiser with the bodies of the scene; events are pushed block by block, and the latency is cut off at the beginning.
#include "runtime/render/render.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <optional>

#include "runtime/base/clock.hpp"
#include "runtime/render/event_playback.hpp"
#include "runtime/render/sensor_playback.hpp"
#include "runtime/scene/microphones.hpp"
#include "runtime/scene/pose.hpp"
#include "runtime/scene/session.hpp"
#include "runtime/synth/bending.hpp"
#include "runtime/synth/texture.hpp"

namespace carillon::render {
namespace {

using synth::Effect;

constexpr std::size_t kBlock = synth::kBlock;
constexpr double kReferencePa = 20e-6;
constexpr double kFastS = 0.125;
constexpr double kFarthestHeardM = 15e3;  // maximum audible distance (-84 dB); bounds the delay lines
constexpr int kMaxWaitingStrikes = 256;   // per body, waiting or active
constexpr int kMaxForces = 512;           // per body that receives forces

/// Summary of the events of one body.
struct BodySummary {
  bool is_played = false;    // has events
  bool is_touched = false;   // has a lasting contact
  bool is_pushed = false;    // has time-stepped forces
  events::BodyMotion first;  // pose at the start
  double reach_m = 0.0;      // maximum distance from the first microphone's initial position
};

std::vector<BodySummary> summarise(const scene::Scene& scene, const std::vector<const bank::Bank*>& banks, const scene::Events& events,
                                   const Vec3& base) {
  std::vector<BodySummary> summaries(scene.bodies.size());
  std::vector<bool> is_placed(scene.bodies.size());
  const auto find = [&](std::int32_t body) -> BodySummary* {
    return body >= 0 && body < std::ssize(summaries) ? &summaries[body] : nullptr;
  };
  events.for_each([&](const events::Event& event) {
    if (const auto* motion = std::get_if<events::BodyMotion>(&event); motion != nullptr && find(motion->body) != nullptr) {
      const std::size_t i = motion->body;
      BodySummary& body = summaries[i];
      if (!is_placed[i]) body.first = *motion;
      if (!is_placed[i] || !scene.bodies[i].spec.fixed) body.reach_m = std::max(body.reach_m, calc_length(motion->position_m - base));
      is_placed[i] = true;
    } else if (const auto* impulse = std::get_if<events::Impulse>(&event)) {
      if (BodySummary* body = find(impulse->body)) body->is_played = true;
    } else if (const auto* force = std::get_if<events::Force>(&event)) {
      if (BodySummary* body = find(force->body)) body->is_played = body->is_pushed = true;
    } else if (const auto* contact = std::get_if<events::LastingContact>(&event)) {
      if (BodySummary* body = find(contact->body)) body->is_played = body->is_touched = true;
    }
  });
  for (std::size_t i = 0; i < summaries.size(); ++i) {
    if (is_placed[i]) continue;
    const physics::Pose& initial = scene.bodies[i].spec.initial;
    summaries[i].first.position_m = scene::calc_world_point(initial, banks[i]->rigid.centre_m);
    summaries[i].first.rotation = initial.rotation;
    summaries[i].reach_m = calc_length(summaries[i].first.position_m - base);
  }
  return summaries;
}

/// Effects of each body, by the plan or else by the scene. Bodies without events and sensors have none, bodies without lasting contacts
/// none of those.
std::vector<synth::EffectSet> find_body_effects(const scene::Scene& scene, const std::vector<BodySummary>& summaries,
                                                const scene::Plan* plan) {
  std::vector<synth::EffectSet> found(summaries.size());
  std::vector<bool> is_sensed(summaries.size());
  for (const scene::SceneSensor& sensor : scene.sensors) is_sensed[sensor.body] = true;
  for (std::size_t i = 0; i < summaries.size(); ++i) {
    if (!summaries[i].is_played && !is_sensed[i]) continue;
    const synth::EffectSet chosen = plan != nullptr ? plan->selector.choose(static_cast<int>(i)) : scene.effects;
    found[i] = find_effects(scene, i, summaries[i].is_touched ? chosen : chosen.without(synth::kContactEffects));
    if (is_sensed[i]) found[i] = found[i].with({Effect::kModal, Effect::kHertzPulse});  // also where they are not heard
  }
  return found;
}

/// Measures the synthesiser's output on its way into the store. The end is held back until the need for a fade is known.
class Outlet {
 public:
  Outlet(sound::SoundStore& store, std::uint64_t frames, bool fades)
      : store_(&store),
        meter_(store.get_rate_hz(), store.get_channels()),
        tail_begin_(fades ? frames - std::min<std::uint64_t>(frames, static_cast<std::uint64_t>(std::llround(kFadeS * store.get_rate_hz())))
                          : frames) {}

  /// Next frames, one span per channel.
  void add(const std::vector<const float*>& channels, std::size_t count) {
    for (std::size_t n = 0; n < count; ++n)
      for (const float* channel : channels) frames_.push_back(channel[n]);
    if (frames_.size() >= kHeld * channels.size()) pass_on();
  }
  void finish(Sound& sound) {
    pass_on();
    const auto peak = std::accumulate(tail_.begin(), tail_.end(), 0.0F, [](float max, float p) { return std::max(max, std::abs(p)); });
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
  /// CPU time spent measuring and storing so far.
  double get_seconds_cpu() const { return seconds_cpu_; }

 private:
  static constexpr std::size_t kHeld = 8192;  // frames per reading of the clock

  void pass_on() {
    const double began = base::get_process_cpu_s();
    const std::size_t channels = store_->get_channels(), count = frames_.size() / channels;
    const std::size_t before = std::min<std::uint64_t>(count, tail_begin_ - std::min(tail_begin_, taken_));
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

  sound::SoundStore* store_;
  Meter meter_;
  std::uint64_t tail_begin_ = 0, taken_ = 0;
  std::vector<float> frames_, tail_;
  double seconds_cpu_ = 0.0;
};

/// Sleep threshold, pressure at 1 m: inaudible if the selector is free to choose.
double find_silence_pa(const scene::Scene& scene, std::size_t body, const scene::Plan* plan) {
  if (scene.quality.silence_pa) return *scene.quality.silence_pa;
  const bool is_planned = plan != nullptr && scene.bodies[body].overrides.automatic && !scene.bodies[body].overrides.on.has(Effect::kModal);
  return is_planned ? plan->selector.calc_silence_pa(static_cast<int>(body)) : synth::BodySettings{}.silence_pa;
}

/// Maximum distance of the microphones from the first one's initial position.
double calc_reach_m(const scene::Scene& scene, const scene::Microphones& microphones, const Vec3& base) {
  double path_m = 0.0, offset_m = 0.0;
  for (const synth::PathPoint& place : scene.listener.path) path_m = std::max(path_m, calc_length(place.position_m - base));
  for (const Vec3& x : microphones.offset_m) offset_m = std::max(offset_m, calc_length(x));
  // A floor adds at most twice the receiver's height.
  double height_m = 0.0;
  if (const std::optional<synth::Floor> floor = scene::find_floor(scene))
    height_m = std::max(0.0, floor->calc_height_m(base)) + path_m + offset_m;
  return path_m + offset_m + 2.0 * height_m + 1.0;
}

/// Renders a scene whose events are all known, block by block.
class Rendering {
 public:
  Rendering(const scene::Scene& scene, const std::vector<const bank::Bank*>& banks, const scene::Events& events,
            const RenderOptions& options)
      : scene_(&scene),
        options_(&options),
        session_(scene, banks, options.rate_hz, options.plan != nullptr || scene.effects.has(Effect::kAccelerationNoise),
                 options.head != nullptr ? *options.head : scene::make_head(scene, options.rate_hz)),
        path_(scene::list_listener_path(session_.get_microphones())),
        base_(session_.get_microphones().centre.find(0.0).position_m),
        summaries_(summarise(scene, banks, events, base_)),
        effects_(find_body_effects(scene, summaries_, options.plan)),
        playback_(events, list_scheduled_bodies(), path_),
        synthesiser_(&open()) {
    if (options.sensors != nullptr && !scene.sensors.empty())
      sensors_.emplace(scene, banks, *synthesiser_, count_frames(scene.duration_s, find_sensor_rate(scene)), *options.sensors);
    if (!scene.surfaces.empty()) surfaces_.emplace(scene, session_.get_microphones(), session_.get_head(), options.rate_hz);
  }

  /// State before the first sample.
  void describe(Sound& sound) const {
    sound.rate_hz = options_->rate_hz;
    sound.channels = session_.get_microphones().offset_m.size();
    for (std::size_t i = 0; i < scene_->bodies.size(); ++i) {
      sound.body_effects.push_back(effects_[i]);
      sound.body_modes.push_back(session_.get_model(i).get_mode_count());
      sound.modes += sound.body_modes.back();
    }
  }

  /// Renders `count` samples, excluding the initial latency, into the outlet.
  void render(std::size_t samples, Outlet& outlet) {
    const std::size_t latency = synthesiser_->get_latency();
    const auto rate_hz = static_cast<double>(options_->rate_hz);
    std::vector<std::array<float, kBlock>> blocks(session_.get_microphones().offset_m.size());
    std::vector<const float*> heard(blocks.size());
    std::vector<float*> out;
    for (auto& block : blocks) out.push_back(block.data());
    for (std::size_t start = 0; start < samples; start += kBlock) {
      const std::size_t count = std::min(kBlock, samples - start);
      playback_.push_until(static_cast<double>(start + kBlock) / rate_hz, *synthesiser_);
      synthesiser_->process(out.data(), static_cast<int>(out.size()), static_cast<int>(count));
      if (sensors_) sensors_->take();
      if (options_->energies != nullptr && start + count <= samples - latency) measure_energies(*options_->energies, start + count);
      if (options_->audits) note_energy();
      const std::size_t skipped = std::min(count, start < latency ? latency - start : 0);
      for (std::size_t c = 0; c < out.size(); ++c) heard[c] = blocks[c].data() + skipped;
      if (surfaces_) {
        std::vector<float*> to;
        for (auto& block : blocks) to.push_back(block.data() + skipped);
        surfaces_->add(to, count - skipped);
      }
      outlet.add(heard, count - skipped);
      if (options_->progress) options_->progress(static_cast<double>(start + count) / static_cast<double>(samples));
    }
  }

  /// Slower sensors lag behind the sound: their samples reach ahead.
  void finish_sensors() {
    std::array<float, kBlock> block{};
    for (float* out = block.data(); sensors_ && !sensors_->is_complete(); sensors_->take()) synthesiser_->process(&out, 1, kBlock);
  }

  std::size_t get_latency() const { return synthesiser_->get_latency(); }

  /// At a sample; at every block that follows a hundredth of a second. Lightly damped modes: lambda A^2 / 2.
  void measure_energies(ModalEnergies& energies, std::size_t sample) {
    const double time_s = static_cast<double>(sample) / options_->rate_hz;
    if (time_s * ModalEnergies::kRateHz < static_cast<double>(energies.time_s.size())) return;
    energies.time_s.push_back(time_s);
    for (std::size_t i = 0; i < scene_->bodies.size(); ++i) {
      const bank::Bank& bank = *scene_->bodies[i].spec.bank;
      amplitudes_.assign(bank.mode_count(), 0.0F);
      synthesiser_->measure_amplitudes(static_cast<int>(i), amplitudes_);
      double energy_j = 0.0;
      for (std::size_t m = 0; m < amplitudes_.size(); ++m) energy_j += 0.5 * bank.eigenvalue_rad2_s2[m] * std::pow(amplitudes_[m], 2.0);
      energies.modes_j.push_back(energy_j);
    }
  }

  void note_energy() {
    double held_j = 0.0;
    for (std::size_t i = 0; i < scene_->bodies.size(); ++i) held_j += synthesiser_->get_mode_energy(static_cast<int>(i)).held_j;
    max_modes_j_ = std::max(max_modes_j_, held_j);
  }

  /// Counters of the synthesiser.
  void count(Sound& sound) const {
    const synth::SynthesiserCounters counters = synthesiser_->get_counters();
    sound.strikes = counters.strikes;
    sound.refused = counters.refused;
    sound.faults = counters.faults + playback_.get_faults();
    sound.resets = counters.resets;
    sound.max_modes_j = max_modes_j_;
    if (surfaces_) sound.surfaces = surfaces_->get_figures();
    for (std::size_t i = 0; i < scene_->bodies.size(); ++i) {
      const int body = static_cast<int>(i);
      sound.body_peak_pa.push_back(synthesiser_->get_peak_pa(body));
      sound.body_deflection.push_back(synthesiser_->get_deflection(body));
      sound.energy_rise = std::max(sound.energy_rise, synthesiser_->get_energy_rise(body));
      sound.mode_energy += synthesiser_->get_mode_energy(body);
      sound.effect_counters.push_back(synthesiser_->get_effect_counters(body));
    }
  }

 private:
  std::vector<scene::ScheduledBody> list_scheduled_bodies() const {
    std::vector<scene::ScheduledBody> bodies;
    for (std::size_t i = 0; i < scene_->bodies.size(); ++i) {
      const synth::EffectSet effects = effects_[i];
      bodies.push_back({.number = static_cast<int>(i),
                        .moves = !effects.is_empty() && !scene_->bodies[i].spec.fixed,
                        .lead_s = scene::calc_strike_lead_s(session_.get_model(i), effects)});
    }
    return bodies;
  }

  /// The synthesiser with its bodies and the capacity that these events need.
  synth::Synthesiser& open() {
    const double ears_reach_m = calc_reach_m(*scene_, session_.get_microphones(), base_);
    std::vector<double> longest_m, longest_s;
    for (const BodySummary& summary : summaries_) {
      longest_m.push_back(std::min(summary.reach_m + ears_reach_m, kFarthestHeardM));
      longest_s.push_back(longest_m.back() / synth::kSoundSpeedMs);
    }
    const std::vector<int> waypoints = playback_.count_waypoints(longest_s);
    synth::SynthesiserOptions room = session_.make_options();
    room.max_strikes = kMaxWaitingStrikes;
    room.max_waypoints = waypoints.back();
    synth::Synthesiser& synthesiser = session_.open(room);
    for (std::size_t i = 0; i < summaries_.size(); ++i) {
      // once per process, before playback
      if (effects_[i].has_any(synth::kContactEffects)) synth::Texture::make_tables();
      synth::BodySettings settings = session_.make_settings(i, effects_[i]);
      settings.position_m = summaries_[i].first.position_m;
      settings.rotation = summaries_[i].first.rotation;
      settings.silence_pa = find_silence_pa(*scene_, i, options_->plan);
      settings.longest_m = longest_m[i];
      settings.max_waypoints = waypoints[i];
      settings.max_forces = summaries_[i].is_pushed ? kMaxForces : 0;
      settings.audits_energy = options_->audits;
      session_.add_body(settings);
    }
    return synthesiser;
  }

  const scene::Scene* scene_;
  const RenderOptions* options_;
  scene::Session session_;
  std::vector<events::Listener> path_;     // path of the listener
  Vec3 base_;                              // initial position of the listener
  std::vector<BodySummary> summaries_;     // per body
  std::vector<synth::EffectSet> effects_;  // per body
  EventPlayback playback_;
  synth::Synthesiser* synthesiser_;
  double max_modes_j_ = 0.0;
  std::optional<SurfacePlayback> surfaces_;  // empty without recorded surfaces
  std::optional<SensorPlayback> sensors_;    // empty without sensors
  std::vector<float> amplitudes_;            // buffer
};

}  // namespace

Sound calc_sound(const scene::Scene& scene, const std::vector<const bank::Bank*>& banks, const scene::Events& events,
                 const RenderOptions& options, sound::SoundStore& store) {
  const double started_s = base::get_process_cpu_s();
  Sound sound;
  Rendering rendering(scene, banks, events, options);
  rendering.describe(sound);
  const std::uint64_t frames = count_frames(scene.duration_s, options.rate_hz);
  Outlet outlet(store, frames, options.fades_end);
  const double began_s = base::get_process_cpu_s();
  rendering.render(frames + rendering.get_latency(), outlet);
  rendering.finish_sensors();
  sound.seconds_playing_cpu = std::max(0.0, base::get_process_cpu_s() - began_s - outlet.get_seconds_cpu());
  outlet.finish(sound);
  rendering.count(sound);
  sound.seconds_cpu = base::get_process_cpu_s() - started_s;
  return sound;
}

std::string describe_bending(const std::string& name, const bank::Bank& bank, double thicknesses) {
  if (!(thicknesses > 0.0)) return {};
  const double thickness_m = synth::find_judged_thickness_m(bank);
  return fmt::format(
      "{}: bends by {:.3g} mm, {:.2g} times its thickness of {:.3g} mm (twice its volume over its surface); linear modes hold up to {:g} "
      "of it, and the sound is approximate; compute its bank with \"nonlinear\" (docs/howto/nonlinear-bodies.md), or strike more softly",
      name, 1e3 * thicknesses * thickness_m, thicknesses, 1e3 * thickness_m, synth::kLinearThicknesses);
}

std::uint64_t count_frames(double duration_s, int rate_hz) { return static_cast<std::uint64_t>(std::llround(duration_s * rate_hz)); }

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

Gain calc_gain(const scene::Output& output, double peak_pa) {
  if (!(peak_pa > 0.0)) return {.per_pa = output.gain_per_pa.value_or(1.0), .reduced = false};
  const double automatic = std::pow(10.0, output.peak_dbfs / 20.0) / peak_pa;
  if (!output.gain_per_pa) return {.per_pa = automatic, .reduced = false};
  if (*output.gain_per_pa * peak_pa <= 1.0) return {.per_pa = *output.gain_per_pa, .reduced = false};
  return {.per_pa = automatic, .reduced = true};
}

}  // namespace carillon::render
