// Events of a scene: from physics and strikes, or from a contacts file.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "runtime/base/spool.hpp"
#include "runtime/events/file.hpp"
#include "runtime/scene/mallets.hpp"
#include "runtime/scene/scene.hpp"

namespace carillon::scene {

/// Events in order of time, of any number.
using Events = base::Records<events::Event>;

/// A list as events, for scenes built in code.
Events make_events(const std::vector<events::Event>& events);

/// All events of a scene; bodies are numbered as in the scene. Events of a contacts file keep the order of the file.
struct SceneEvents {
  std::vector<events::RecordedBody> bodies;
  Events events;
  std::int64_t steps = 0;  // of the physics
  physics::EnergyAudit energy{};
  physics::ContactAudit contacts{};
  std::vector<Blow> blows{};  // mallets
  std::vector<std::string> warnings{};
};

/// Writes the events as a contacts file, in pieces, in order.
void write_recording(const SceneEvents& happened, const std::function<void(std::string_view)>& sink);

/// Numbers of impulses; a pulse of several events::Forces counts once.
struct Tally {
  std::vector<std::int64_t> body_impulses;  // per body
  std::int64_t impulses = 0;
  std::int64_t contacts = 0;  // a contact of two bodies counts once
};
Tally count_impulses(const Events& events, std::size_t bodies);

/// True if any body can move; otherwise there is no physics.
bool has_physics(const Scene& scene);

/// Bodies, ground and gravity for the physics. Every body's spec has its bank.
physics::WorldSpec make_world(const Scene& scene);

/// Runs the physics if any body can move, and adds the strikes. Every body's spec has its bank. `has_contacts`: record lasting contacts;
/// `audits`: balance energy and audit contacts. `progress` (may be empty) receives the finished fraction. `spool` stores the events. Throws
/// InputError and SolveError naming the scene.
SceneEvents simulate(const Scene& scene, bool has_contacts, bool audits, const std::function<void(double)>& progress,
                     base::Spool spool = base::Spool());

/// The events of a contacts file. Throws InputError for an invalid file, or one made for other bodies than the scene's (number, order,
/// names, surfaces). Files without surface data are compared by numbers of triangles, with a warning.
SceneEvents read_scene_events(const std::filesystem::path& file, const Scene& scene, base::Spool spool = base::Spool());

}  // namespace carillon::scene
