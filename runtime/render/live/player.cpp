// Method: one thread advances the physics in slices until it is `look_ahead_s` ahead of the card, and pushes events when due; the card's
// thread plays them. If physics falls behind, impulses act late and are counted.
#include "runtime/render/live/player.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <memory>
#include <thread>
#include <vector>

#include "runtime/base/clock.hpp"
#include "runtime/base/printable.hpp"
#include "runtime/events/events.hpp"
#include "runtime/physics/world.hpp"
#include "runtime/render/live/device.hpp"
#include "runtime/render/live/schedule.hpp"
#include "runtime/render/render.hpp"
#include "runtime/render/surface_playback.hpp"
#include "runtime/scene/banks.hpp"
#include "runtime/scene/event_scheduler.hpp"
#include "runtime/scene/events.hpp"
#include "runtime/scene/planning.hpp"
#include "runtime/scene/scene.hpp"
#include "runtime/scene/session.hpp"
#include "runtime/scene/strikes.hpp"
#include "runtime/synth/load_keeper.hpp"
#include "runtime/synth/synthesiser.hpp"

namespace carillon::live {
namespace {

constexpr double kSliceS = 0.01;   // CPU time of physics between two checks of the ring
constexpr double kChangeS = 0.03;  // lead of a change of effects over the events that need it
constexpr double kMarginS = 0.01;  // lead of waypoints and contact records over strikes
// Longest time that a pushed event waits; bounds the synthesiser's queues, however far ahead the physics is.
constexpr double kPushedS = 0.25;
constexpr int kMaxStrikes = 1024, kMaxForces = 2048;  // per body, waiting or active
constexpr int kMaxWaypoints = 1024, kRingEvents = 1 << 14;

void warn(const std::vector<std::string>& warnings) {
  for (const std::string& warning : warnings) fmt::print(stderr, "carillon-live: warning: {}\n", base::printable(warning));
}

/// Physics of a scene, advanced in slices ahead of the sound. Every event goes once, in order of time, to the selector and the scheduler.
class Physics {
 public:
  Physics(const scene::Scene& scene, effects::EffectSelector& selector, scene::EventScheduler& scheduler)
      : selector_(&selector), scheduler_(&scheduler), end_s_(scene.duration_s) {
    if (!scene::has_physics(scene)) return;
    try {
      world_ =
          std::make_unique<physics::World>(scene::make_world(scene), physics::WorldOptions{.contact_step_s = scene.quality.contact_step_s,
                                                                                           .joint_tolerance = scene.quality.joint_tolerance,
                                                                                           .end_s = scene.duration_s,
                                                                                           .modes = scene.quality.modes_in_impacts,
                                                                                           .masks_hits = scene.quality.masking,
                                                                                           .lasting_contacts = selector.needs_contacts()});
    } catch (const InputError& error) {
      throw InputError(fmt::format("{}: {}", scene.file.string(), error.what()));
    }
  }

  /// Advances towards a time for one slice of CPU time. False if nothing is to be done: physics advances by whole windows, and the last one
  /// may have to wait.
  bool advance(double until_s) {
    if (world_ == nullptr || time_s_ >= std::min(until_s, end_s_)) return false;
    const double began_s = counted_s_ = base::get_thread_cpu_s(), was_s = time_s_;
    time_s_ = world_->advance(std::min(until_s, end_s_), kSliceS, [this](const events::Event& event) {
      scheduler_->add(event);
      selector_->watch(event);
      if (std::holds_alternative<events::TimeWatermark>(event)) end_window();
    });
    const double now_s = base::get_thread_cpu_s();
    window_cpu_s_ += now_s - counted_s_;
    return time_s_ > was_s || now_s - began_s >= kSliceS;
  }
  /// Largest CPU time of one window of physics (2 ms of scene time).
  double get_worst_window_s() const { return worst_window_s_; }
  /// Time up to which all events are known.
  double get_time_s() const { return world_ == nullptr || time_s_ >= end_s_ ? std::numeric_limits<double>::infinity() : time_s_; }

 private:
  /// Physics marks the end of each window.
  void end_window() {
    const double now_s = base::get_thread_cpu_s();
    worst_window_s_ = std::max(worst_window_s_, window_cpu_s_ + now_s - counted_s_);
    window_cpu_s_ = 0.0;
    counted_s_ = now_s;
  }

  effects::EffectSelector* selector_;
  scene::EventScheduler* scheduler_;
  std::unique_ptr<physics::World> world_;
  double time_s_ = 0.0, end_s_ = 0.0;
  double window_cpu_s_ = 0.0, worst_window_s_ = 0.0, counted_s_ = 0.0;
};

/// Lead times over the sound. Effects of a body are set kChangeS before the first event that needs them is pushed.
struct Lead {
  double look_ahead_s;  // physics
  bool plans;           // the lead suffices for the selector; else each body has all effects it may need
  double changed_s;     // effects: planned lead_s before the events that need them, sent this much ahead
  double pushed_s;      // events

  Lead(double look_ahead, double selector_lead_s)
      : look_ahead_s(look_ahead),
        plans(look_ahead >= selector_lead_s + effects::kTickS + kChangeS + kMarginS),
        changed_s(std::max(0.0, std::min(look_ahead - selector_lead_s, kPushedS + kChangeS + kMarginS - selector_lead_s))),
        pushed_s(std::min(kPushedS, plans ? changed_s + selector_lead_s - kChangeS - kMarginS : look_ahead)) {}
};

/// Playback pipeline: physics, plan, events, sound, each ahead of the next by the times in Lead.
class Player {
 public:
  Player(const scene::Scene& scene, const std::vector<const bank::Bank*>& banks, const PlayerOptions& options)
      : scene_(&scene),
        lead_(options.look_ahead_s, scene.quality.thresholds.lead_s),
        session_(scene, banks, scene.sample_rate_hz, true, scene::make_head(scene, scene.sample_rate_hz)),
        selector_(scene::make_facts(scene, session_.get_microphones(), scene::has_physics(scene))),
        scheduler_(list_scheduled_bodies(), kMarginS),
        physics_(scene, selector_, scheduler_),
        schedule_(scene.bodies.size()),
        synthesiser_(&open()) {
    synthesiser_->set_gain(options.gain_per_pa > 0.0 ? options.gain_per_pa : scene.output.gain_per_pa.value_or(1.0));
    const scene::Strikes strikes = scene::make_strikes(scene, banks);
    warn(strikes.warnings);
    for (const events::Event& strike : strikes.events) {
      selector_.watch(strike);
      scheduler_.add(strike);
    }
    const std::vector<events::Listener> path = scene::list_listener_path(session_.get_microphones());
    scheduler_.add_listener(path);
  }

  synth::Synthesiser& get_synthesiser() { return *synthesiser_; }

  /// Adds the bodies with their initial effects and pushes the first events.
  void begin() {
    while (advance(lead_.look_ahead_s)) {
    }
    std::vector<synth::EffectSet> first;  // without planning: all effects that a body might need
    for (std::size_t i = 0; i < scene_->bodies.size(); ++i) first.push_back(selector_.get_possible(static_cast<int>(i)));
    if (lead_.plans) schedule_.apply(0.0, lead_.changed_s, [&](std::size_t body, synth::EffectSet effects) { first[body] = effects; });
    for (std::size_t i = 0; i < first.size(); ++i) session_.add_body(session_.make_settings(i, scene::find_effects(*scene_, i, first[i])));
    push(0.0);
  }

  /// Work when the sound has reached a time. False if the physics need not advance.
  bool step(double now_s) {
    const bool advanced = advance(now_s + lead_.look_ahead_s);
    min_lead_s_ = std::min(min_lead_s_, physics_.get_time_s() - synthesiser_->get_time_s());
    synthesiser_->collect();
    if (lead_.plans)
      schedule_.apply(now_s, now_s + lead_.changed_s, [&](std::size_t body, synth::EffectSet effects) {
        synthesiser_->set_effects(static_cast<int>(body), scene::find_effects(*scene_, body, effects));
      });
    push(now_s);
    return advanced;
  }

  /// Smallest lead of the physics over the sound; infinite without physics.
  double get_min_lead_s() const { return min_lead_s_; }
  double get_worst_window_s() const { return physics_.get_worst_window_s(); }
  std::int64_t get_faults() const { return scheduler_.get_faults(); }

 private:
  std::vector<scene::ScheduledBody> list_scheduled_bodies() const {
    std::vector<scene::ScheduledBody> bodies;
    for (std::size_t i = 0; i < scene_->bodies.size(); ++i) {
      const synth::EffectSet effects = scene::find_effects(*scene_, i, selector_.get_possible(static_cast<int>(i)));
      bodies.push_back({.number = static_cast<int>(i),
                        .moves = !scene_->bodies[i].spec.fixed,
                        .lead_s = scene::calc_strike_lead_s(session_.get_model(i), effects)});
    }
    return bodies;
  }

  synth::Synthesiser& open() {
    synth::SynthesiserOptions room = session_.make_options();
    room.max_strikes = kMaxStrikes;
    room.max_forces = kMaxForces;
    room.max_waypoints = kMaxWaypoints;
    room.ring_events = kRingEvents;
    return session_.open(room);
  }

  /// The selector decides as the physics advances, so few events are kept.
  bool advance(double until_s) {
    const bool advanced = physics_.advance(until_s);
    if (!lead_.plans) return advanced;
    for (const effects::EffectChange& change : selector_.advance(std::min(physics_.get_time_s(), until_s))) schedule_.add(change);
    return advanced;
  }

  /// Events that do not fit into the ring wait.
  void push(double now_s) {
    scheduler_.push_until(now_s + lead_.pushed_s, physics_.get_time_s(),
                          [this](const events::Event& event) { return synthesiser_->push(event); });
  }

  const scene::Scene* scene_;
  Lead lead_;
  scene::Session session_;
  effects::EffectSelector selector_;
  scene::EventScheduler scheduler_;
  Physics physics_;
  Schedule schedule_;
  synth::Synthesiser* synthesiser_;
  double min_lead_s_ = std::numeric_limits<double>::infinity();
};

void print_statistics(const DeviceStatistics& card, const synth::SynthesiserCounters& counters, const Player& player, double rate_hz) {
  const double card_s = std::max(static_cast<double>(card.frames), 1.0) / rate_hz;
  fmt::print("played             {:.2f} s in {} blocks, {} underflows, latency {:.1f} ms\n", static_cast<double>(card.frames) / rate_hz,
             card.callbacks, card.underflows, 1e3 * card.latency_s);
  fmt::print("strikes            {}, {} late, {} refused\n", counters.strikes, counters.late, counters.refused);
  if (const std::int64_t faults = counters.faults + player.get_faults(); faults > 0)
    fmt::print("faulty events      {}, not played\n", faults);
  fmt::print("physics            {} times behind the sound", counters.underruns);
  if (const double lead_s = player.get_min_lead_s(); std::isfinite(lead_s))
    fmt::print(", {:.0f} ms {} at the worst; 2 ms of it took {:.1f} ms of CPU at most", 1e3 * std::abs(lead_s),
               lead_s < 0.0 ? "behind" : "in front", 1e3 * player.get_worst_window_s());
  fmt::print("\n");
  fmt::print("work               {:.1f} % of a core, {:.3g} mode-samples/s, {} groups of modes faded\n", 100.0 * card.busy_s / card_s,
             static_cast<double>(counters.mode_samples) / card_s, counters.faded);
}

}  // namespace

void play(const PlayerOptions& options) {
  scene::Scene scene = scene::read_scene(options.scene);
  render::refuse_surfaces(scene, "carillon-live");
  const scene::Banks banks = scene::read_banks(scene, options.quiet);
  std::vector<const bank::Bank*> body_banks;
  for (const scene::SceneBody& body : scene.bodies) body_banks.push_back(body.spec.bank);
  warn(scene.warnings);
  Player player(scene, body_banks, options);
  synth::Synthesiser& synthesiser = player.get_synthesiser();
  const double rate_hz = scene.sample_rate_hz;
  Device device(synthesiser, {.name = options.device, .null = options.null, .rate_hz = rate_hz, .frames = options.frames});
  player.begin();
  device.start();
  synth::LoadKeeper keeper;
  for (double now_s = 0.0; now_s < scene.duration_s; now_s = synthesiser.get_time_s()) {
    const bool advanced = player.step(now_s);
    if (options.cpu_share > 0.0) keeper.keep(synthesiser, options.cpu_share, device.get_statistics().busy_s);
    if (!advanced) std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  device.stop();
  for (std::size_t i = 0; i < scene.bodies.size(); ++i)
    if (const std::string text =
            render::describe_bending(scene.bodies[i].name, *body_banks[i], synthesiser.get_deflection(static_cast<int>(i)));
        !text.empty())
      warn({text});
  if (!options.quiet) print_statistics(device.get_statistics(), synthesiser.get_counters(), player, rate_hz);
}

}  // namespace carillon::live
