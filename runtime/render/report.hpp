// Output of a rendering as JSON: paths of the bodies, and figures of the run.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "runtime/render/render.hpp"
#include "runtime/scene/events.hpp"

namespace carillon::render {

/// Writes paths (at most 200 poses a second), ground and impulses in pieces, in order. Layout: docs/howto/scene-files.md. `spool` buffers
/// the paths.
void write_trajectory(const scene::Scene& scene, const std::vector<const bank::Bank*>& banks, const scene::Events& events,
                      base::Spool spool, const std::function<void(std::string_view)>& sink);

/// Energy balance and its errors.
struct EnergyBooks {
  physics::EnergyAudit bodies;  // zeros with a contacts file
  double modes_rise = 0.0;      // Sound::energy_rise
  synth::ModeEnergy modes;      // Sound::mode_energy
};

/// Energy balance of a rendering with --audit. Modal energy is the larger of two figures: the physics (impacts, all bodies) and the sound
/// (all forces, audible bodies). Energy of the sound beyond that of the physics is deducted from the losses of the physics (friction,
/// contacts), unless it has an external source (strikes, mallets, contacts file).
EnergyBooks make_books(const scene::Scene& scene, const physics::EnergyAudit& physics, const Sound& sound);

/// Warnings of the contact audit, one sentence each.
std::vector<std::string> list_contact_warnings(const scene::Scene& scene, const physics::ContactAudit& contacts,
                                               const physics::EnergyAudit& energy);
/// "'ball' and the ground"; "none" without a body.
std::string describe_pair(const scene::Scene& scene, int body, int other);

/// One line about modes whose radiation gains were limited by their damping; empty if there are none.
std::string describe_limited(const scene::SceneBody& body);

/// Figures of one rendering.
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
  physics::ContactAudit contacts{};  // audits only
  std::vector<scene::Blow> blows;    // mallets
  double real_time_factor = 0.0;     // (physics_s + sound_s) / duration; below 1: faster than real time
};
std::string make_report_json(const scene::Scene& scene, const Sound& sound, const scene::Plan& plan, const Figures& figures);

}  // namespace carillon::render
