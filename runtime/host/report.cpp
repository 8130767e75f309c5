#include "runtime/host/report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>

#include "runtime/config/document.hpp"
#include "runtime/config/printable.hpp"
#include "runtime/host/pose.hpp"
#include "runtime/plan/table.hpp"
#include "runtime/synth/kernels.hpp"

namespace carillon::host {
namespace {

constexpr double kPosesPerS = 200.0;
constexpr std::size_t kMostChanges = 10000;

/// JSON has no infinity: silence has the level null.
std::string make_level(double db) { return std::isfinite(db) ? fmt::format("{:.2f}", db) : "null"; }

/// Every pose that lies at least 1 / 200 s after the one kept before it, and the last.
std::vector<contact::Pose> find_kept_poses(const std::vector<contact::Pose>& poses) {
  std::vector<contact::Pose> kept;
  for (const contact::Pose& pose : poses) {
    if (kept.empty() || pose.time_s - kept.back().time_s >= 1.0 / kPosesPerS - 1e-12) kept.push_back(pose);
  }
  if (!poses.empty() && kept.back().time_s < poses.back().time_s) {
    if (kept.size() > 1) kept.pop_back();
    kept.push_back(poses.back());
  }
  return kept;
}

contact::Vec3 find_contact_point(const bank::Bank& bank, const contact::Impulse& impulse) {
  contact::Vec3 point{};
  for (int corner = 0; corner < 3; ++corner) {
    const auto vertex = static_cast<std::size_t>(bank.triangles[static_cast<std::size_t>(impulse.triangle)][corner]);
    for (int k = 0; k < 3; ++k) point[k] += impulse.barycentric[corner] * bank.vertices_m[vertex][k];
  }
  return point;
}

/// What the effects of a body have done and cost, as members of a JSON object.
plan::MoreJson list_measured(const Sound& sound, std::size_t body, double duration_s) {
  plan::MoreJson more;
  const synth::EffectCounters& counters = sound.effect_counters[body];
  for (const synth::Effect effect : synth::EffectSet::all()) {
    more[effect] =
        fmt::format("\"measured_us_per_s\": {:.4g}, \"units\": {}",
                    1e6 * static_cast<double>(counters.ticks[effect]) * sound.seconds_per_tick / duration_s, counters.units[effect]);
  }
  return more;
}

}  // namespace

std::string make_trajectory_json(const Scene& scene, const std::vector<const bank::Bank*>& banks, const contact::Simulation& simulation) {
  std::string json = "{\n \"bodies\": [";
  auto out = std::back_inserter(json);
  for (std::size_t i = 0; i < scene.bodies.size(); ++i) {
    const SceneBody& body = scene.bodies[i];
    fmt::format_to(out, "{}\n  {{\"name\": {}, \"bank\": {}, \"fixed\": {},\n   \"poses\": [", i == 0 ? "" : ",", config::quote(body.name),
                   config::quote(body.bank.string()), body.spec.fixed);
    const std::vector<contact::Pose> poses =
        i < simulation.poses.size() ? find_kept_poses(simulation.poses[i]) : std::vector<contact::Pose>{};
    for (std::size_t k = 0; k < poses.size(); ++k) {
      const contact::Pose& p = poses[k];
      fmt::format_to(out, "{}\n    [{:.6f}, {:.7g}, {:.7g}, {:.7g}, {:.7g}, {:.7g}, {:.7g}, {:.7g}]", k == 0 ? "" : ",", p.time_s,
                     p.position_m[0], p.position_m[1], p.position_m[2], p.rotation[0], p.rotation[1], p.rotation[2], p.rotation[3]);
    }
    json += "\n   ]}";
  }
  fmt::format_to(out, "\n ],\n \"ground\": {{\"height_m\": {}}},\n \"up\": \"z\",\n \"impulses\": [",
                 scene.ground ? fmt::format("{:.9g}", scene.ground->height_m) : "null");
  bool first = true;
  for (const contact::Impulse& impulse : simulation.impulses) {
    if (impulse.body < 0 || static_cast<std::size_t>(impulse.body) >= scene.bodies.size()) continue;
    const auto i = static_cast<std::size_t>(impulse.body);
    const contact::Pose pose = simulation.poses[i].empty() ? scene.bodies[i].spec.initial : find_pose(simulation.poses[i], impulse.time_s);
    const contact::Vec3 x = calc_world_point(pose, find_contact_point(*banks[i], impulse));
    const double size = std::hypot(impulse.impulse_n_s[0], impulse.impulse_n_s[1], impulse.impulse_n_s[2]);
    fmt::format_to(out,
                   "{}\n  {{\"time_s\": {:.9f}, \"body\": {}, \"other\": {}, \"world_m\": [{:.6g}, {:.6g}, {:.6g}], \"impulse_n_s\": "
                   "{:.6g}, \"duration_s\": {:.6g}}}",
                   first ? "" : ",", impulse.time_s, impulse.body, impulse.other, x[0], x[1], x[2], size, impulse.duration_s);
    first = false;
  }
  json += "\n ]\n}\n";
  return json;
}

std::string make_report_json(const Scene& scene, const contact::Simulation& simulation, const Sound& sound, const Plan& plan,
                             const Figures& f) {
  std::string json = "{\n";
  auto out = std::back_inserter(json);
  fmt::format_to(out, " \"scene\": {},\n \"duration_s\": {},\n \"sample_rate_hz\": {},\n \"samples\": {},\n \"channels\": {},\n",
                 config::quote(scene.file.string()), scene.duration_s, sound.rate_hz, sound.pressure_pa[0].size(),
                 sound.pressure_pa.size());
  fmt::format_to(
      out,
      " \"instructions\": \"{}\",\n \"bodies\": {},\n \"modes\": {},\n \"contacts\": {},\n \"impulses\": {},\n \"impulses_played\": {},\n "
      "\"impulses_refused\": {},\n \"resets\": {},\n",
      synth::get_name(synth::get_kernels(scene.quality.instructions).isa), f.bodies, f.modes, f.contacts, simulation.impulses.size(),
      sound.strikes, sound.refused, sound.resets);
  fmt::format_to(out,
                 " \"physics_steps\": {},\n \"physics_s\": {:.4f},\n \"physics_cpu_s\": {:.5f},\n \"sound_s\": {:.4f},\n \"sound_cpu_s\": "
                 "{:.5f},\n \"playing_cpu_s\": {:.6f},\n "
                 "\"real_time_factor\": {:.4f},\n",
                 simulation.steps, f.physics_s, f.physics_cpu_s, f.sound_s, sound.seconds_cpu, sound.seconds_playing_cpu,
                 f.real_time_factor);
  fmt::format_to(
      out, " \"peak_pa\": {:.6g},\n \"mean_db_spl\": {},\n \"loudest_db_spl\": {},\n \"gain_per_pa\": {:.6g},\n \"gain_reduced\": {},\n",
      f.peak_pa, make_level(f.levels.mean_db), make_level(f.levels.loudest_db), f.gain.per_pa, f.gain.reduced);
  if (f.audit) {
    const contact::EnergyAudit& bodies = f.audit->bodies;
    fmt::format_to(out,
                   " \"energy\": {{\"rise_j\": {:.6g}, \"hit_rise_j\": {:.6g}, \"largest_kinetic_j\": {:.6g}, \"weight_n\": {:.6g}, "
                   "\"modes_rise\": {:.6g}}},\n",
                   bodies.rise_j, bodies.hit_rise_j, bodies.kinetic_j, bodies.weight_n, f.audit->modes_rise);
  }
  json += " \"warnings\": [";
  for (std::size_t i = 0; i < scene.warnings.size(); ++i) json += (i == 0 ? "" : ", ") + config::quote(config::printable(scene.warnings[i]));
  json += "],\n \"per_body\": [";
  for (std::size_t i = 0; i < scene.bodies.size(); ++i) {
    const auto played = std::count_if(simulation.impulses.begin(), simulation.impulses.end(),
                                      [i](const contact::Impulse& impulse) { return impulse.body == static_cast<std::int32_t>(i); });
    fmt::format_to(out, "{}\n  {{\"name\": {}, \"modes\": {}, \"impulses\": {}, \"peak_pa_at_1m\": {:.6g},\n   \"effects\": {}}}",
                   i == 0 ? "" : ",", config::quote(scene.bodies[i].name), sound.body_modes[i], played, sound.body_peak_pa[i],
                   plan::make_plan_json(plan.planner, plan.facts, static_cast<int>(i), list_measured(sound, i, scene.duration_s)));
  }
  fmt::format_to(out, "\n ],\n \"changes\": {}\n}}\n", plan::make_changes_json(plan.changes, plan.facts, kMostChanges));
  return json;
}

std::int64_t count_contacts(const contact::Simulation& simulation) {
  return std::count_if(simulation.impulses.begin(), simulation.impulses.end(),
                       [](const contact::Impulse& impulse) { return impulse.other < 0 || impulse.body < impulse.other; });
}

}  // namespace carillon::host
