// Method: one thread advances the physics in slices until it is `look_ahead_s` ahead of the card, and pushes events when due; the card's
// thread plays them. If physics falls behind, impulses act late and are counted.
#include "runtime/render/live/player.hpp"

#include <fmt/core.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <limits>
#include <memory>
#include <thread>
#include <vector>

#include "runtime/base/clock.hpp"
#include "runtime/base/printable.hpp"
#include "runtime/events/events.hpp"
#include "runtime/physics/world.hpp"
#include "runtime/render/live/commands.hpp"
#include "runtime/render/live/device.hpp"
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
constexpr double kMarginS = 0.01;  // lead of waypoints and contact records over strikes
// Longest time that a pushed event waits; bounds the synthesiser's queues, however far ahead the physics is.
constexpr double kPushedS = 0.25;
constexpr int kMaxStrikes = 1024, kMaxForces = 2048;  // per body, waiting or active
constexpr int kMaxWaypoints = 1024, kRingEvents = 1 << 14;

void warn(const std::vector<std::string>& warnings) {
  for (const std::string& warning : warnings) fmt::print(stderr, "carillon-live: warning: {}\n", base::printable(warning));
}

/// Physics of a scene, advanced in slices ahead of the sound. Its events go to the scheduler in order of time.
class Physics {
 public:
  Physics(const scene::Scene& scene, bool has_contacts, scene::EventScheduler& scheduler)
      : scheduler_(&scheduler), end_s_(scene.duration_s) {
    if (!scene::has_physics(scene)) return;
    try {
      world_ =
          std::make_unique<physics::World>(scene::make_world(scene), physics::WorldOptions{.contact_step_s = scene.quality.contact_step_s,
                                                                                           .joint_tolerance = scene.quality.joint_tolerance,
                                                                                           .end_s = scene.duration_s,
                                                                                           .modes = scene.quality.modes_in_impacts,
                                                                                           .masks_hits = scene.quality.masking,
                                                                                           .lasting_contacts = has_contacts});
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
      if (std::holds_alternative<events::TimeWatermark>(event)) end_window();
    });
    const double now_s = base::get_thread_cpu_s();
    window_cpu_s_ += now_s - counted_s_;
    return time_s_ > was_s || now_s - began_s >= kSliceS;
  }
  /// nullptr: no body can move.
  physics::World* get_world() { return world_.get(); }
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

  scene::EventScheduler* scheduler_;
  std::unique_ptr<physics::World> world_;
  double time_s_ = 0.0, end_s_ = 0.0;
  double window_cpu_s_ = 0.0, worst_window_s_ = 0.0, counted_s_ = 0.0;
};

/// Plays a scene: physics ahead of the events, events ahead of the sound. Bodies have all effects that they may need.
class Player {
 public:
  Player(const scene::Scene& scene, const std::vector<const bank::Bank*>& banks, const PlayerOptions& options)
      : scene_(&scene),
        look_ahead_s_(options.look_ahead_s),
        takes_commands_(options.takes_commands),
        pushed_s_(std::min(kPushedS, options.look_ahead_s)),
        session_(scene, banks, scene.sample_rate_hz, true, scene::make_head(scene, scene.sample_rate_hz)),
        selector_(scene::make_facts(scene, session_.get_microphones(), scene::has_physics(scene))),
        scheduler_(list_scheduled_bodies(), kMarginS),
        physics_(scene, selector_.needs_contacts(), scheduler_),
        synthesiser_(&open()) {
    synthesiser_->set_gain(options.gain_per_pa > 0.0 ? options.gain_per_pa : scene.output.gain_per_pa.value_or(1.0));
    const scene::Strikes strikes = scene::make_strikes(scene, banks);
    warn(strikes.warnings);
    for (const events::Event& strike : strikes.events) scheduler_.add(strike);
    const std::vector<events::Listener> path = scene::list_listener_path(session_.get_microphones());
    scheduler_.add_listener(path);
  }

  synth::Synthesiser& get_synthesiser() { return *synthesiser_; }

  /// Adds the bodies and pushes the first events.
  void begin() {
    while (physics_.advance(look_ahead_s_)) {
    }
    for (std::size_t i = 0; i < scene_->bodies.size(); ++i) session_.add_body(session_.make_settings(i, find_effects(i)));
    push(0.0);
  }

  /// Work when the sound has reached a time. False if the physics need not advance.
  bool step(double now_s) {
    const bool advanced = physics_.advance(now_s + look_ahead_s_);
    min_lead_s_ = std::min(min_lead_s_, physics_.get_time_s() - synthesiser_->get_time_s());
    synthesiser_->collect();
    push(now_s);
    return advanced;
  }

  Hands make_hands() {
    Hands hands{.world = physics_.get_world(), .names = {}};
    for (const scene::SceneBody& body : scene_->bodies) hands.names.push_back(body.name);
    return hands;
  }

  /// Smallest lead of the physics over the sound; infinite without physics.
  double get_min_lead_s() const { return min_lead_s_; }
  double get_worst_window_s() const { return physics_.get_worst_window_s(); }
  std::int64_t get_faults() const { return scheduler_.get_faults(); }

 private:
  synth::EffectSet find_effects(std::size_t body) const {
    return scene::find_effects(*scene_, body, selector_.get_possible(static_cast<int>(body)));
  }

  std::vector<scene::ScheduledBody> list_scheduled_bodies() const {
    std::vector<scene::ScheduledBody> bodies;
    for (std::size_t i = 0; i < scene_->bodies.size(); ++i) {
      bodies.push_back({.number = static_cast<int>(i),
                        .moves = takes_commands_ || !scene_->bodies[i].spec.fixed,
                        .lead_s = scene::calc_strike_lead_s(session_.get_model(i), find_effects(i))});
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

  /// Events that do not fit into the ring wait.
  void push(double now_s) {
    scheduler_.push_until(now_s + pushed_s_, physics_.get_time_s(),
                          [this](const events::Event& event) { return synthesiser_->push(event); });
  }

  const scene::Scene* scene_;
  double look_ahead_s_;  // of the physics
  bool takes_commands_;  // which may move fixed bodies too
  double pushed_s_;      // of the events
  scene::Session session_;
  effects::EffectSelector selector_;
  scene::EventScheduler scheduler_;
  Physics physics_;
  synth::Synthesiser* synthesiser_;
  double min_lead_s_ = std::numeric_limits<double>::infinity();
};

/// Carries out the commands that have arrived. False: quit.
bool obey(LineReader& reader, const Hands& hands) {
  for (const std::string& line : reader.read()) {
    if (line == "quit") return false;
    try {
      if (const std::string text = carry_out(line, hands); !text.empty()) {
        fmt::print("{}\n", text);
        std::fflush(stdout);
      }
    } catch (const InputError& error) {
      warn({error.what()});
    }
  }
  return true;
}

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
  LineReader reader(STDIN_FILENO);
  const Hands hands = player.make_hands();
  for (double now_s = 0.0; now_s < scene.duration_s; now_s = synthesiser.get_time_s()) {
    if (options.takes_commands && !obey(reader, hands)) break;
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
