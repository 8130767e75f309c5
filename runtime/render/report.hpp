// What a rendering says about itself, as JSON: the paths of the bodies for pictures, and the figures of the run.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "runtime/scene/events.hpp"
#include "runtime/render/render.hpp"

namespace carillon::render {

/// Paths (at most 200 poses a second), ground and impulses, in pieces, in order. Layout: docs/howto/scene-files.md. `spool` takes the
/// paths meanwhile.
void write_trajectory(const scene::Scene& scene, const std::vector<const bank::Bank*>& banks, const scene::Events& events, base::Spool spool,
                      const std::function<void(std::string_view)>& sink);

/// Where energy is and went, and whether any came from nowhere.
struct EnergyBooks {
  physics::EnergyAudit bodies;  // of the physics; zeros where a contacts file took its place
  double modes_rise = 0.0;      // Sound::energy_rise
  synth::ModeEnergy modes;      // Sound::mode_energy
};

/// Energy books of a rendering with --audit. The energy of modes is the larger of two: in the physics, from impacts on all bodies; in the
/// sound, from all forces on audible bodies. A surplus of the sound comes off the losses of the physics (friction, contacts), unless it
/// came from outside (strikes, mallets, a contacts file).
EnergyBooks make_books(const scene::Scene& scene, const physics::EnergyAudit& physics, const Sound& sound);

/// Warnings of the audit of contacts, a sentence each.
std::vector<std::string> list_contact_warnings(const scene::Scene& scene, const physics::ContactAudit& contacts,
                                               const physics::EnergyAudit& energy);
/// "'ball' and the ground"; "none" without a body.
std::string describe_pair(const scene::Scene& scene, int body, int other);

/// One line about modes whose gains came down to what their damping takes; empty where there are none.
std::string describe_limited(const scene::SceneBody& body);

/// The figures of one rendering.
struct Figures {
  std::size_t bodies = 0;
  int modes = 0;
  scene::Tally tally;
  std::int64_t physics_steps = 0;
  double physics_s = 0.0;  // wall clock
  double physics_cpu_s = 0.0;
  double sound_s = 0.0;
  Gain gain;
  std::optional<EnergyBooks> audit;
  physics::ContactAudit contacts{};  // with it
  std::vector<scene::Blow> blows;           // of mallets
  double real_time_factor = 0.0;     // (physics_s + sound_s) / duration: below 1 is faster than real time
};
std::string make_report_json(const scene::Scene& scene, const Sound& sound, const scene::Plan& plan, const Figures& figures);

}  // namespace carillon::render
