#include "runtime/host/events.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <queue>

#include "runtime/contact/world.hpp"
#include "runtime/host/pose.hpp"
#include "runtime/host/strikes.hpp"

namespace carillon::host {
namespace {

events::SurfaceMark mark_surface(const bank::Bank& bank) {
  Vec3 low = bank.vertices_m.front(), high = low, sum{};
  for (const Vec3& vertex : bank.vertices_m) {
    for (std::size_t k = 0; k < 3; ++k) {
      low[k] = std::min(low[k], vertex[k]);
      high[k] = std::max(high[k], vertex[k]);
    }
  }
  double weights = 0.0;
  for (std::size_t t = 0; t < bank.triangles.size(); ++t) {
    const auto weight = static_cast<double>(t + 1);
    weights += weight;
    for (const std::int32_t corner : bank.triangles[t]) {
      for (std::size_t k = 0; k < 3; ++k) sum[k] += weight / 3.0 * bank.vertices_m[static_cast<std::size_t>(corner)][k];
    }
  }
  events::SurfaceMark mark;
  for (std::size_t k = 0; k < 3; ++k) {
    mark.size_m[k] = high[k] - low[k];
    mark.order_m[k] = sum[k] / weights;
  }
  return mark;
}

std::vector<events::RecordedBody> list_bodies(const Scene& scene) {
  std::vector<events::RecordedBody> bodies;
  for (const SceneBody& body : scene.bodies) {
    const bank::Bank& bank = *body.spec.bank;
    bodies.push_back({body.name, static_cast<std::int64_t>(bank.triangles.size()), mark_surface(bank)});
  }
  return bodies;
}

std::string format_size(const Vec3& size_m) { return fmt::format("{:.4g} x {:.4g} x {:.4g} m", size_m[0], size_m[1], size_m[2]); }

/// Where no body can move there is no physics: every body stays where the scene puts it.
std::vector<events::Event> make_still(const Scene& scene) {
  std::vector<events::Event> events;
  for (std::size_t i = 0; i < scene.bodies.size(); ++i) {
    const contact::BodySpec& spec = scene.bodies[i].spec;
    events::BodyMotion motion;
    motion.body = static_cast<std::int32_t>(i);
    motion.position_m = calc_world_point(spec.initial, spec.bank->rigid.centre_m);
    motion.rotation = spec.initial.rotation;
    events.emplace_back(motion);
  }
  return events;
}

/// Puts what a world says in order of time, and strikes between it: of what happens at one time, first what the world says, as it came.
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

  /// Nothing before that time will come.
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
  contact::World world(make_world(scene), {.contact_step_s = scene.quality.contact_step_s,
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
  happened.steps = world.get_statistics().steps;
  happened.energy = world.get_statistics().energy;
}

/// Throws InputError unless the file's bodies are the scene's.
void check_bodies(const std::filesystem::path& file, const std::vector<events::RecordedBody>& theirs,
                  const std::vector<events::RecordedBody>& ours, std::vector<std::string>& warnings) {
  if (theirs.size() != ours.size()) {
    throw InputError(fmt::format("{}: is of {} bodies, and the scene has {}; play it with the scene that it was made for", file.string(),
                                 theirs.size(), ours.size()));
  }
  for (std::size_t i = 0; i < ours.size(); ++i) {
    if (theirs[i].name != ours[i].name) {
      throw InputError(fmt::format("{}: body {} is \"{}\", and \"{}\" in the scene; play it with the scene that it was made for",
                                   file.string(), i, theirs[i].name, ours[i].name));
    }
    if (theirs[i].triangles != ours[i].triangles) {
      throw InputError(
          fmt::format("{}: was made for a bank of \"{}\" with {} triangles, and the scene's has {}; use banks of the same mesh",
                      file.string(), ours[i].name, theirs[i].triangles, ours[i].triangles));
    }
    if (theirs[i].surface && !events::is_same_surface(*theirs[i].surface, *ours[i].surface)) {
      const std::string were = format_size(theirs[i].surface->size_m), are = format_size(ours[i].surface->size_m);
      throw InputError(were == are
                           ? fmt::format("{}: was made for another surface of \"{}\", of the same size and number of triangles; use "
                                         "a bank of the same mesh",
                                         file.string(), ours[i].name)
                           : fmt::format("{}: was made for a body \"{}\" of {}, and the scene's bank measures {}; use a bank of the "
                                         "same mesh and size, or record the contacts again",
                                         file.string(), ours[i].name, were, are));
    }
  }
  const auto is_unmarked = [](const events::RecordedBody& body) { return !body.surface; };
  if (std::any_of(theirs.begin(), theirs.end(), is_unmarked)) {
    warnings.push_back(fmt::format(
        "{}: does not say how large its bodies are (\"size_m\", \"order_m\"); that they have as many triangles as the scene's is all "
        "that was compared",
        file.string()));
  }
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
      ++tally.body_impulses[static_cast<std::size_t>(body)];
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

contact::WorldSpec make_world(const Scene& scene) {
  contact::WorldSpec spec;
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
  Strikes strikes = make_strikes(scene, banks);  // they are refused before the physics, if at all
  happened.blows = std::move(strikes.blows);
  happened.warnings = std::move(strikes.warnings);
  InOrder events(std::move(strikes.events), happened.events);
  if (!has_physics(scene)) {
    for (const events::Event& event : make_still(scene)) events.take(event);
  } else {
    try {
      for (std::string& question : contact::ask_about_links(make_world(scene))) happened.warnings.push_back(std::move(question));
      run_physics(scene, has_contacts, audits, progress, events, happened);
    } catch (const InputError& error) {
      if (std::string_view(error.what()).starts_with(scene.file.string() + ":")) throw;  // of a key, with its line
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

}  // namespace carillon::host
