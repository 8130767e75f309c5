// Method: the physics advances in slices until it is `look_ahead_s` ahead of the sound; events are pushed when due. If physics falls
// behind, impulses act late and are counted.
#include "runtime/render/stage.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <variant>

#include "runtime/base/clock.hpp"
#include "runtime/base/document.hpp"
#include "runtime/base/error.hpp"
#include "runtime/events/events.hpp"
#include "runtime/scene/events.hpp"
#include "runtime/scene/planning.hpp"
#include "runtime/scene/scene_bodies.hpp"
#include "runtime/scene/strikes.hpp"

namespace carillon::render {
namespace {

constexpr double kSliceS = 0.01;   // CPU time of physics between two checks of the ring
constexpr double kMarginS = 0.01;  // lead of waypoints and contact records over strikes
// Longest time that a pushed event waits; bounds the synthesiser's queues, however far ahead the physics is.
constexpr double kPushedS = 0.25;
constexpr int kMaxStrikes = 1024, kMaxForces = 2048;  // per body, waiting or active
constexpr int kMaxWaypoints = 1024, kRingEvents = 1 << 14;

std::vector<const bank::Bank*> list_banks(const scene::Scene& scene) {
  std::vector<const bank::Bank*> banks;
  for (const scene::SceneBody& body : scene.bodies) banks.push_back(body.spec.bank);
  return banks;
}

}  // namespace

int find_body(const std::vector<std::string>& names, const std::string& name) {
  const auto at = std::find(names.begin(), names.end(), name);
  if (at != names.end()) return static_cast<int>(at - names.begin());
  const std::string nearest = base::find_nearest(name, names);
  throw InputError(fmt::format("no body is called \"{}\"{}", name, nearest.empty() ? "" : fmt::format("; did you mean \"{}\"?", nearest)));
}

/// Physics of a scene, advanced in slices ahead of the sound. Its events go to the scheduler in order of time.
class Stage::Physics {
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

Stage::Stage(scene::Scene& scene, const StageOptions& options)
    : scene_(&scene),
      is_handled_(options.is_handled),
      look_ahead_s_(options.look_ahead_s),
      pushed_s_(std::min(kPushedS, options.look_ahead_s)),
      session_(scene, list_banks(scene), scene.sample_rate_hz, true, scene::make_head(scene, scene.sample_rate_hz)),
      selector_(scene::make_facts(scene, session_.get_microphones(), scene::has_physics(scene))),
      scheduler_(list_scheduled_bodies(), kMarginS),
      physics_(std::make_unique<Physics>(scene, selector_.needs_contacts(), scheduler_)),
      synthesiser_(&open()) {
  synthesiser_->set_gain(options.gain_per_pa);
  scene::Strikes strikes = scene::make_strikes(scene, list_banks(scene));
  warnings_ = std::move(strikes.warnings);
  for (const events::Event& strike : strikes.events) scheduler_.add(strike);
  const std::vector<events::Listener> path = scene::list_listener_path(session_.get_microphones());
  scheduler_.add_listener(path);
}

Stage::~Stage() = default;

physics::World* Stage::get_world() { return physics_->get_world(); }

double Stage::get_worst_window_s() const { return physics_->get_worst_window_s(); }

void Stage::begin() {
  while (physics_->advance(look_ahead_s_)) {
  }
  for (std::size_t i = 0; i < scene_->bodies.size(); ++i) session_.add_body(session_.make_settings(i, find_effects(i)));
  push(0.0);
}

bool Stage::step(double now_s) {
  const bool advanced = physics_->advance(now_s + look_ahead_s_);
  min_lead_s_ = std::min(min_lead_s_, physics_->get_time_s() - synthesiser_->get_time_s());
  synthesiser_->collect();
  push(now_s);
  return advanced;
}

synth::EffectSet Stage::find_effects(std::size_t body) const {
  return scene::find_effects(*scene_, body, selector_.get_possible(static_cast<int>(body)));
}

scene::ScheduledBody Stage::schedule(std::size_t body, synth::EffectSet effects) const {
  return {.number = static_cast<int>(body),
          .moves = is_handled_ || !scene_->bodies[body].spec.fixed,
          .lead_s = scene::calc_strike_lead_s(session_.get_model(body), effects)};
}

std::vector<scene::ScheduledBody> Stage::list_scheduled_bodies() const {
  std::vector<scene::ScheduledBody> bodies;
  for (std::size_t i = 0; i < scene_->bodies.size(); ++i) bodies.push_back(schedule(i, find_effects(i)));
  return bodies;
}

std::string Stage::add_body(const std::string& text, scene::Banks& banks) {
  physics::World* const world = get_world();
  if (world == nullptr) throw InputError("no body of the scene can move, so that it has no physics");
  if (synthesiser_->is_full()) throw InputError(fmt::format("{} bodies have been added, the maximum of a run", kMaxAdded));
  scene::SceneBody body = scene::parse_new_body(base::parse_document(text, scene_->file.parent_path() / "new body"), *scene_);
  scene::read_bank(*scene_, body, banks);
  const std::size_t number = scene_->bodies.size();
  scene_->bodies.push_back(std::move(body));
  try {
    session_.add_model(scene_->bodies[number].spec.bank);
    world->add(scene_->bodies[number].spec);
  } catch (...) {
    session_.keep_models(number);
    scene_->bodies.pop_back();
    throw;
  }
  scene::Scene alone = *scene_;
  alone.bodies = {scene_->bodies[number]};
  alone.strikes.clear();
  const effects::EffectSelector selector(scene::make_facts(alone, session_.get_microphones(), true));
  const synth::EffectSet effects = scene::find_effects(*scene_, number, selector.get_possible(0));
  scheduler_.add_body(schedule(number, effects));
  session_.add_body(session_.make_settings(number, effects));
  return scene_->bodies[number].name;
}

synth::Synthesiser& Stage::open() {
  synth::SynthesiserOptions room = session_.make_options();
  room.max_strikes = kMaxStrikes;
  room.max_forces = kMaxForces;
  room.max_waypoints = kMaxWaypoints;
  room.ring_events = kRingEvents;
  if (is_handled_) room.max_bodies += kMaxAdded;
  return session_.open(room);
}

/// Events that do not fit into the ring wait.
void Stage::push(double now_s) {
  scheduler_.push_until(now_s + pushed_s_, physics_->get_time_s(),
                        [this](const events::Event& event) { return synthesiser_->push(event); });
}

}  // namespace carillon::render
