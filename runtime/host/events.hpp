// What happens in a scene: by its physics and its strikes, or from a contacts file.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "runtime/host/scene.hpp"
#include "runtime/stream/file.hpp"

namespace carillon::host {

/// Everything that happens in a scene, in order of time. The bodies are those of the scene, in its order.
struct Course {
  stream::Recording recording;
  std::int64_t steps = 0;  // of the physics
  contact::EnergyAudit energy{};
  std::vector<std::string> warnings;
};

/// Whether any body can move: without one there is no physics.
bool has_physics(const Scene& scene);

/// Bodies, ground and gravity as physics takes them. Every body's spec has its bank.
contact::WorldSpec make_world(const Scene& scene);

/// Runs the physics, if any body can move, and adds the strikes. Every body's spec has its bank. `has_contacts`: with records of contacts
/// that last; `audits`: with the books of energy. `progress` (may be empty) is called with the finished fraction. Throws InputError and
/// SolveError, which name the scene.
Course simulate(const Scene& scene, bool has_contacts, bool audits, const std::function<void(double)>& progress);

/// The events of a contacts file. Throws InputError when it is none, or was made for other bodies than the scene's: as many, of the same
/// names, with the same surface in their banks, in the same order. A file that does not say which surfaces it was made for is compared by
/// their numbers of triangles, with a warning.
Course read_course(const std::filesystem::path& file, const Scene& scene);

}  // namespace carillon::host
