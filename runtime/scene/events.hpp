// What happens in a scene: by its physics and its strikes, or from a contacts file.
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

/// What happens, in order of time, however much it is.
using Events = base::Records<events::Event>;

/// A list as events, for scenes that are made by hand.
Events make_events(const std::vector<events::Event>& events);

/// Everything that happens in a scene. The bodies are those of the scene, in its order. Events of a contacts file stay in the order of the
/// file.
struct SceneEvents {
  std::vector<events::RecordedBody> bodies;
  Events events;
  std::int64_t steps = 0;  // of the physics
  physics::EnergyAudit energy{};
  physics::ContactAudit contacts{};
  std::vector<Blow> blows{};  // of mallets
  std::vector<std::string> warnings{};
};

/// The events as the text of a contacts file, in pieces, in order.
void write_recording(const SceneEvents& happened, const std::function<void(std::string_view)>& sink);

/// How many impulses bodies get; a pulse of several events::Forces is one.
struct Tally {
  std::vector<std::int64_t> body_impulses;  // per body
  std::int64_t impulses = 0;
  std::int64_t contacts = 0;  // one between two bodies counts once
};
Tally count_impulses(const Events& events, std::size_t bodies);

/// Whether any body can move: without one there is no physics.
bool has_physics(const Scene& scene);

/// Bodies, ground and gravity as physics takes them. Every body's spec has its bank.
physics::WorldSpec make_world(const Scene& scene);

/// Runs the physics, if any body can move, and adds the strikes. Every body's spec has its bank. `has_contacts`: with records of contacts
/// that last; `audits`: with the books of energy and the audit of contacts. `progress` (may be empty) is called with the finished fraction.
/// `spool` takes the events. Throws InputError and SolveError, which name the scene.
SceneEvents simulate(const Scene& scene, bool has_contacts, bool audits, const std::function<void(double)>& progress,
                     base::Spool spool = base::Spool());

/// The events of a contacts file. Throws InputError when it is none, or was made for other bodies than the scene's: as many, of the same
/// names, with the same surface in their banks, in the same order. A file that does not say which surfaces it was made for is compared by
/// their numbers of triangles, with a warning.
SceneEvents read_scene_events(const std::filesystem::path& file, const Scene& scene, base::Spool spool = base::Spool());

}  // namespace carillon::scene
