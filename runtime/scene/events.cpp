#include "runtime/scene/events.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <queue>

#include "runtime/physics/world.hpp"
#include "runtime/scene/pose.hpp"
#include "runtime/scene/recorded_bodies.hpp"
#include "runtime/scene/strikes.hpp"

namespace carillon::scene {
namespace {

/// Without moving bodies there is no physics: every body stays at its initial pose.
std::vector<events::Event> make_still(const Scene& scene) {
  std::vector<events::Event> events;
  for (std::size_t i = 0; i < scene.bodies.size(); ++i) {
    const physics::BodySpec& spec = scene.bodies[i].spec;
    events::BodyMotion motion;
    motion.body = static_cast<std::int32_t>(i);
    motion.position_m = calc_world_point(spec.initial, spec.bank->rigid.centre_m);
    motion.rotation = spec.initial.rotation;
    events.emplace_back(motion);
  }
  return events;
}

/// Merges events of the physics with strikes in order of time; at equal times those of the physics come first.
class InOrder {
 public:
  InOrder(std::vector<events::Event> strikes, Events& out) : strikes_(std::move(strikes)), out_(&out) {}

  void take(const events::Event& event) {
    waiting_.push({events::get_time_s(event), order_++, event});
    if (const auto* mark = std::get_if<events::TimeWatermark>(&event)) release(mark->time_s);
  }
  void finish() {
    release(std::numeric_limits<double>::infinity());
    for (; next_ < strikes_.size(); ++next_) out_->append(strikes_[next_]);
  }

 private:
  struct Waiting {
    double time_s = 0.0;
    std::int64_t order = 0;
    events::Event event;
    bool operator>(const Waiting& other) const { return time_s != other.time_s ? time_s > other.time_s : order > other.order; }
  };

  /// No earlier event follows.
  void release(double until_s) {
    for (; !waiting_.empty() && waiting_.top().time_s < until_s; waiting_.pop()) {
      for (; next_ < strikes_.size() && events::get_time_s(strikes_[next_]) < waiting_.top().time_s; ++next_) out_->append(strikes_[next_]);
      out_->append(waiting_.top().event);
    }
  }

  std::vector<events::Event> strikes_;
  Events* out_;
  std::size_t next_ = 0;
  std::int64_t order_ = 0;
  std::priority_queue<Waiting, std::vector<Waiting>, std::greater<>> waiting_;
};

void run_physics(const Scene& scene, bool has_contacts, bool audits, const std::function<void(double)>& progress, InOrder& events,
                 SceneEvents& happened) {
  physics::World world(make_world(scene), {.contact_step_s = scene.quality.contact_step_s,
                                           .joint_tolerance = scene.quality.joint_tolerance,
                                           .end_s = scene.duration_s,
                                           .modes = scene.quality.modes_in_impacts,
                                           .masks_hits = scene.quality.masking,
                                           .lasting_contacts = has_contacts,
                                           .audits_energy = audits});
  constexpr int kParts = 100;
  for (int part = 1; part <= kParts; ++part) {
    world.advance(scene.duration_s * part / kParts, std::numeric_limits<double>::infinity(),
                  [&](const events::Event& event) { events.take(event); });
    if (progress) progress(static_cast<double>(part) / kParts);
  }
  const physics::Statistics statistics = world.get_statistics();
  happened.steps = statistics.steps;
  happened.energy = statistics.energy;
  happened.contacts = statistics.contacts;
}

}  // namespace

Events make_events(const std::vector<events::Event>& events) {
  Events records;
  records.append(std::span(events));
  return records;
}

void write_recording(const SceneEvents& happened, const std::function<void(std::string_view)>& sink) {
  constexpr std::size_t kPiece = 1 << 16;
  std::string text = events::format_header(happened.bodies, happened.events.size());
  happened.events.for_each([&](const events::Event& event) {
    events::append_line(text, event);
    if (text.size() < kPiece) return;
    sink(text);
    text.clear();
  });
  sink(text);
}

Tally count_impulses(const Events& events, std::size_t bodies) {
  Tally tally;
  tally.body_impulses.assign(bodies, 0);
  events.for_each([&](const events::Event& event) {
    const auto count = [&](std::int32_t body, std::int32_t other) {
      if (body < 0 || static_cast<std::size_t>(body) >= bodies) return;
      ++tally.impulses;
      ++tally.body_impulses[body];
      if (other < 0 || body < other) ++tally.contacts;
    };
    if (const auto* impulse = std::get_if<events::Impulse>(&event)) count(impulse->body, impulse->other);
    if (const auto* force = std::get_if<events::Force>(&event); force != nullptr && !force->continues) count(force->body, force->other);
  });
  return tally;
}

bool has_physics(const Scene& scene) {
  return std::any_of(scene.bodies.begin(), scene.bodies.end(), [](const SceneBody& body) { return !body.spec.fixed; });
}

physics::WorldSpec make_world(const Scene& scene) {
  physics::WorldSpec spec;
  for (const SceneBody& body : scene.bodies) spec.bodies.push_back(body.spec);
  spec.ground = scene.ground;
  spec.gravity_m_s2 = scene.gravity_m_s2;
  spec.joints = scene.joints;
  spec.cords = scene.cords;
  return spec;
}

SceneEvents simulate(const Scene& scene, bool has_contacts, bool audits, const std::function<void(double)>& progress, base::Spool spool) {
  SceneEvents happened{.bodies = list_bodies(scene), .events = Events(std::move(spool))};
  std::vector<const bank::Bank*> banks;
  for (const SceneBody& body : scene.bodies) banks.push_back(body.spec.bank);
  Strikes strikes = make_strikes(scene, banks);  // throws before the physics starts
  happened.blows = std::move(strikes.blows);
  happened.warnings = std::move(strikes.warnings);
  InOrder events(std::move(strikes.events), happened.events);
  if (!has_physics(scene)) {
    for (const events::Event& event : make_still(scene)) events.take(event);
  } else {
    try {
      for (std::string& question : physics::ask_about_links(make_world(scene))) happened.warnings.push_back(std::move(question));
      run_physics(scene, has_contacts, audits, progress, events, happened);
    } catch (const InputError& error) {
      if (std::string_view(error.what()).starts_with(scene.file.string() + ":")) throw;  // already names a line of the scene
      throw InputError(fmt::format("{}: {}", scene.file.string(), error.what()));
    } catch (const SolveError& error) {
      throw SolveError(fmt::format("{}: {}", scene.file.string(), error.what()));
    }
  }
  events.finish();
  return happened;
}

SceneEvents read_scene_events(const std::filesystem::path& file, const Scene& scene, base::Spool spool) {
  SceneEvents happened{.bodies = list_bodies(scene), .events = Events(std::move(spool))};
  (void)events::read_recording(
      file, [&](const events::Event& event) { happened.events.append(event); },
      [&](const std::vector<events::RecordedBody>& theirs) { check_bodies(file, theirs, happened.bodies, happened.warnings); });
  return happened;
}

}  // namespace carillon::scene
