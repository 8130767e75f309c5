// What a rendering says about itself, as JSON: the paths of the bodies for pictures, and the figures of the run.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "runtime/host/render.hpp"

namespace carillon::host {

/// Paths (at most 200 poses a second), ground and impulses. Layout: docs/howto/scene-files.md.
std::string make_trajectory_json(const Scene& scene, const std::vector<const bank::Bank*>& banks, const contact::Simulation& simulation);

/// Where energy came from nowhere, if anywhere.
struct EnergyBooks {
  contact::EnergyAudit bodies;  // of the physics; zeros where a contacts file took its place
  double modes_rise = 0.0;      // Sound::energy_rise
};

/// The figures of one rendering.
struct Figures {
  std::size_t bodies = 0;
  int modes = 0;
  std::int64_t contacts = 0;  // a contact between two bodies counts once
  double physics_s = 0.0;     // wall clock
  double physics_cpu_s = 0.0;
  double sound_s = 0.0;
  double peak_pa = 0.0;
  Levels levels;
  Gain gain;
  std::optional<EnergyBooks> audit;
  double real_time_factor = 0.0;  // (physics_s + sound_s) / duration: below 1 is faster than real time
};
std::string make_report_json(const Scene& scene, const contact::Simulation& simulation, const Sound& sound, const Plan& plan,
                             const Figures& figures);

/// Number of contacts among the impulses.
std::int64_t count_contacts(const contact::Simulation& simulation);

}  // namespace carillon::host
