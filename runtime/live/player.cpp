// Method:     one thread runs the physics in slices until it is `look_ahead_s` ahead of the card and hands its events on in order of time;
//             the card's thread plays them. Where physics falls behind, impulses act late, which is counted.
// Source:     none.
// Deviations: none.
#include "runtime/live/player.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <deque>
#include <limits>
#include <map>
#include <memory>
#include <thread>
#include <vector>

#include "runtime/base/cpu_clock.hpp"
#include "runtime/base/printable.hpp"
#include "runtime/contact/world.hpp"
#include "runtime/host/banks.hpp"
#include "runtime/host/events.hpp"
#include "runtime/host/microphones.hpp"
#include "runtime/host/planning.hpp"
#include "runtime/host/pose.hpp"
#include "runtime/host/render.hpp"
#include "runtime/host/scene.hpp"
#include "runtime/host/strikes.hpp"
#include "runtime/live/device.hpp"
#include "runtime/live/schedule.hpp"
#include "runtime/radiation/gains.hpp"
#include "runtime/synth/load_keeper.hpp"
#include "runtime/synth/model.hpp"
#include "runtime/synth/synthesiser.hpp"

namespace carillon::live {
namespace {

constexpr double kSliceS = 0.01;   // of CPU time for physics, between two looks at the ring
constexpr double kChangeS = 0.03;  // by which a change of effects is sent before the events that call for it
// Events are handed on at most this long before they are heard, however far physics is in front: the synthesiser has room for what waits so
// long.
constexpr double kHandedS = 0.25;
constexpr int kMostStrikes = 1024, kMostForces = 2048;  // of a body that wait or act

/// Physics and strikes of a scene as one stream, in order of time.
class Course {
 public:
  /// The planner watches what is to be played as soon as it is known.
  Course(const host::Scene& scene, const std::vector<const bank::Bank*>& banks, plan::Planner& planner) : planner_(&planner) {
    host::Strikes strikes = host::make_strikes(scene, banks);
    for (const std::string& warning : strikes.warnings) fmt::print(stderr, "carillon-live: warning: {}\n", base::printable(warning));
    strikes_ = std::move(strikes.events);
    for (const stream::Event& strike : strikes_) planner.watch(strike);
    if (!host::has_physics(scene)) return;
    try {
      world_ =
          std::make_unique<contact::World>(host::make_world(scene), contact::WorldOptions{.contact_step_s = scene.quality.contact_step_s,
                                                                                          .joint_tolerance = scene.quality.joint_tolerance,
                                                                                          .end_s = scene.duration_s,
                                                                                          .modes = scene.quality.modes_in_impacts,
                                                                                          .masks_hits = scene.quality.masking,
                                                                                          .lasting_contacts = planner.needs_contacts()});
    } catch (const InputError& error) {
      throw InputError(fmt::format("{}: {}", scene.file.string(), error.what()));
    }
    end_s_ = scene.duration_s;
  }

  /// Advances towards a time, for a slice of CPU time. False when there is nothing to do: physics goes by whole windows, the last of which
  /// may have to wait.
  bool advance(double until_s) {
    if (world_ == nullptr || time_s_ >= std::min(until_s, end_s_)) return false;
    const double began_s = counted_s_ = base::get_thread_cpu_s(), was_s = time_s_;
    time_s_ = world_->advance(std::min(until_s, end_s_), kSliceS, [this](const stream::Event& event) {
      waiting_.push_back(event);
      planner_->watch(event);
      if (std::holds_alternative<stream::Mark>(event)) end_window();
    });
    const double now_s = base::get_thread_cpu_s();
    window_cpu_s_ += now_s - counted_s_;
    return time_s_ > was_s || now_s - began_s >= kSliceS;
  }
  /// The most CPU time that a window of the physics, 2 ms of the scene, has taken.
  double get_worst_window_s() const { return worst_window_s_; }
  /// Up to where it is known what happens.
  double get_time_s() const { return world_ == nullptr || time_s_ >= end_s_ ? std::numeric_limits<double>::infinity() : time_s_; }

  /// Hands on what happens before a time, as far as there is room, and says how far physics has run.
  void hand_on(double until_s, synth::Synthesiser& synthesiser) {
    while (true) {
      const bool has_strike = next_ < strikes_.size() && stream::get_time_s(strikes_[next_]) <= until_s;
      const bool has_event = !waiting_.empty() && stream::get_time_s(waiting_.front()) <= until_s;
      if (!has_strike && !has_event) break;
      const bool takes_strike = has_strike && (!has_event || stream::get_time_s(strikes_[next_]) < stream::get_time_s(waiting_.front()));
      if (!synthesiser.push(takes_strike ? strikes_[next_] : waiting_.front())) return;  // full: later
      if (takes_strike)
        ++next_;
      else
        waiting_.pop_front();
    }
    const double known_s = std::min(get_time_s(), until_s);
    if (known_s > marked_s_ && synthesiser.push(stream::Mark{known_s})) marked_s_ = known_s;
  }

 private:
  /// The physics marks the end of each window.
  void end_window() {
    const double now = base::get_thread_cpu_s();
    worst_window_s_ = std::max(worst_window_s_, window_cpu_s_ + now - counted_s_);
    window_cpu_s_ = 0.0;
    counted_s_ = now;
  }

  std::vector<stream::Event> strikes_;
  plan::Planner* planner_;
  std::size_t next_ = 0;
  std::unique_ptr<contact::World> world_;
  std::deque<stream::Event> waiting_;
  double time_s_ = 0.0, end_s_ = 0.0, marked_s_ = -1.0;
  double window_cpu_s_ = 0.0, worst_window_s_ = 0.0, counted_s_ = 0.0;
};

/// The way of a listener that walks, as events.
class Walk {
 public:
  explicit Walk(const synth::Track& way) : way_(&way), next_(way.is_still() ? std::numeric_limits<std::int64_t>::max() : 0) {}
  void hand_on(double until_s, synth::Synthesiser& synthesiser) {
    constexpr double kEveryS = 0.01;
    for (; static_cast<double>(next_) * kEveryS <= until_s; ++next_) {
      const synth::Waypoint at = way_->find(static_cast<double>(next_) * kEveryS);
      if (!synthesiser.push(stream::Listener{.time_s = at.time_s, .position_m = at.position_m, .velocity_m_s = at.velocity_m_s})) return;
    }
  }

 private:
  const synth::Track* way_;
  std::int64_t next_;
};

}  // namespace

void play(const PlayerOptions& options) {
  host::Scene scene = host::read_scene(options.scene);
  const host::Banks banks = host::read_banks(scene);
  std::vector<const bank::Bank*> body_banks;
  for (const host::SceneBody& body : scene.bodies) body_banks.push_back(body.spec.bank);
  for (const std::string& warning : scene.warnings) fmt::print(stderr, "carillon-live: warning: {}\n", base::printable(warning));
  const double rate_hz = scene.sample_rate_hz;

  const host::Microphones microphones = host::make_microphones(scene);
  synth::Synthesiser synthesiser({.rate_hz = rate_hz,
                                  .microphones_m = microphones.offset_m,
                                  .listener_m = microphones.centre.find(0.0).position_m,
                                  .max_bodies = static_cast<int>(scene.bodies.size()),
                                  .max_strikes = kMostStrikes,
                                  .max_forces = kMostForces,
                                  .max_waypoints = 1024,
                                  .ring_events = 1 << 14,
                                  .budget = host::calc_budget(scene.quality, rate_hz),
                                  .ground = host::make_ground(scene)});
  synthesiser.set_gain(options.gain_per_pa > 0.0 ? options.gain_per_pa : scene.output.gain_per_pa.value_or(1.0));
  Device device(synthesiser, {.name = options.device, .null = options.null, .rate_hz = rate_hz, .frames = options.frames});
  plan::Planner planner(host::make_facts(scene, microphones, host::has_physics(scene)));
  // Physics must be known so far ahead that the planner can decide.
  const bool plans = options.look_ahead_s >= scene.quality.planner.lead_s + plan::kTickS + kChangeS;
  Course course(scene, body_banks, planner);
  // An effect is planned lead_s before the events that call for it, and is there kChangeS before they are handed on.
  const double lead_s = scene.quality.planner.lead_s;
  const double changed_s = std::max(0.0, std::min(options.look_ahead_s - lead_s, kHandedS + kChangeS - lead_s));
  const double handed_s = std::min(kHandedS, plans ? changed_s + lead_s - kChangeS : options.look_ahead_s);
  Schedule schedule(scene.bodies.size());
  // As the physics goes on, so that the planner keeps few events.
  const auto advance_to = [&](double until_s) {
    const bool advanced = course.advance(until_s);
    if (!plans) return advanced;
    for (const plan::Change& change : planner.advance(std::min(course.get_time_s(), until_s))) schedule.add(change);
    return advanced;
  };
  while (advance_to(options.look_ahead_s)) {
  }
  std::vector<synth::EffectSet> first;  // without time to plan, all that a body might call for
  for (std::size_t i = 0; i < scene.bodies.size(); ++i) first.push_back(planner.get_possible(static_cast<int>(i)));
  if (plans) schedule.apply(0.0, changed_s, [&](std::size_t body, synth::EffectSet effects) { first[body] = effects; });
  std::map<const bank::Bank*, std::shared_ptr<const synth::Model>> models;
  for (std::size_t i = 0; i < scene.bodies.size(); ++i) {
    const contact::BodySpec& spec = scene.bodies[i].spec;
    auto& model = models[spec.bank];
    if (model == nullptr) model = synth::Model::make(*spec.bank, {.rate_hz = rate_hz, .sphere_radius_m = scene.bodies[i].sphere_radius_m});
    synthesiser.add_body(model, {.position_m = host::calc_world_point(spec.initial, spec.bank->rigid.centre_m),
                                 .rotation = spec.initial.rotation,
                                 .effects = host::find_effects(scene, i, first[i]),
                                 .silence_pa = scene.quality.silence_pa.value_or(synth::BodySettings{}.silence_pa),
                                 .surface = host::make_surface(scene.bodies[i]),
                                 .isa = scene.quality.instructions});
  }
  Walk walk(microphones.centre);
  course.hand_on(handed_s, synthesiser);
  walk.hand_on(kHandedS, synthesiser);
  device.start();
  synth::LoadKeeper keeper;
  double least_lead_s = std::numeric_limits<double>::infinity();  // of physics to the sound
  for (double now = 0.0; now < scene.duration_s; now = synthesiser.get_time_s()) {
    const bool advanced = advance_to(now + options.look_ahead_s);
    least_lead_s = std::min(least_lead_s, course.get_time_s() - synthesiser.get_time_s());
    synthesiser.collect();
    if (plans)
      schedule.apply(now, now + changed_s, [&](std::size_t body, synth::EffectSet effects) {
        synthesiser.set_effects(static_cast<int>(body), host::find_effects(scene, body, effects));
      });
    course.hand_on(now + handed_s, synthesiser);
    walk.hand_on(now + kHandedS, synthesiser);
    if (options.cpu_share > 0.0) keeper.keep(synthesiser, options.cpu_share, device.get_statistics().busy_s);
    if (!advanced) std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  device.stop();
  const DeviceStatistics card = device.get_statistics();
  const synth::SynthesiserCounters counters = synthesiser.get_counters();
  if (options.quiet) return;
  const double card_s = std::max(static_cast<double>(card.frames), 1.0) / rate_hz;
  fmt::print("played             {:.2f} s in {} blocks, {} underflows, latency {:.1f} ms\n", static_cast<double>(card.frames) / rate_hz,
             card.callbacks, card.underflows, 1e3 * card.latency_s);
  fmt::print("strikes            {}, {} late, {} refused\n", counters.strikes, counters.late, counters.refused);
  fmt::print("physics            {} times behind the sound", counters.underruns);
  if (std::isfinite(least_lead_s))
    fmt::print(", {:.0f} ms {} at the worst; 2 ms of it took {:.1f} ms of CPU at most", 1e3 * std::abs(least_lead_s),
               least_lead_s < 0.0 ? "behind" : "in front", 1e3 * course.get_worst_window_s());
  fmt::print("\n");
  fmt::print("work               {:.1f} % of a core, {:.3g} mode-samples/s, {} groups of modes faded\n", 100.0 * card.busy_s / card_s,
             static_cast<double>(counters.mode_samples) / card_s, counters.faded);
}

}  // namespace carillon::live
