#include "runtime/host/report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <optional>

#include "runtime/base/document.hpp"
#include "runtime/base/printable.hpp"
#include "runtime/host/pose.hpp"
#include "runtime/plan/table.hpp"
#include "runtime/synth/kernels.hpp"

namespace carillon::host {
namespace {

constexpr double kPosesPerS = 200.0;
constexpr std::size_t kPiece = 1 << 16;  // bytes that are handed on at once

/// JSON has no infinity: silence has the level null.
std::string make_level(double db) { return std::isfinite(db) ? fmt::format("{:.2f}", db) : "null"; }

using Paths = base::RecordLists<contact::Pose>;

/// Where each body has been. After an impact it is where it was before.
Paths collect_paths(const std::vector<const bank::Bank*>& banks, const Events& events, base::Spool spool) {
  Paths paths(banks.size(), std::move(spool));
  std::vector<std::optional<double>> last_s(banks.size());
  events.for_each([&](const stream::Event& event) {
    const auto* motion = std::get_if<stream::Motion>(&event);
    if (motion == nullptr || motion->body < 0 || static_cast<std::size_t>(motion->body) >= banks.size()) return;
    const auto body = static_cast<std::size_t>(motion->body);
    if (last_s[body] && *last_s[body] >= motion->time_s) return;
    last_s[body] = motion->time_s;
    paths.append(body, contact::calc_pose(*motion, banks[body]->rigid.centre_m));
  });
  return paths;
}

/// Every pose that lies at least 1 / 200 s after the one kept before it, and the last, which takes the place of the one before.
template <class Work>
void for_kept_poses(const Paths& paths, std::size_t body, Work&& work) {
  Paths::Reader reader(paths, body);
  std::optional<contact::Pose> waiting, last;  // kept, yet the last may replace it; read
  std::size_t kept = 0;
  double kept_s = 0.0;
  for (const contact::Pose* pose = reader.peek(); pose != nullptr; pose = reader.peek()) {
    last = *pose;
    reader.next();
    if (kept > 0 && !(last->time_s - kept_s >= 1.0 / kPosesPerS - 1e-12)) continue;
    if (waiting) work(*waiting);
    waiting = last;
    kept_s = last->time_s;
    ++kept;
  }
  if (!last) return;
  const bool is_kept = !(kept_s < last->time_s);
  if (waiting && (is_kept || kept == 1)) work(*waiting);
  if (!is_kept) work(*last);
}

/// Follows a path as time goes on.
class PathCursor {
 public:
  PathCursor(const Paths& paths, std::size_t body) : reader_(paths, body) {
    const contact::Pose* first = reader_.peek();
    if (first == nullptr) return;
    around_ = {*first};
    reader_.next();
  }
  bool is_empty() const { return around_.empty(); }
  /// As find_pose of the whole path, for times that hardly go back.
  contact::Pose find(double time_s) {
    while (around_.back().time_s <= time_s) {
      const contact::Pose* next = reader_.peek();
      if (next == nullptr) break;
      if (around_.size() == 2 * kKept) around_.erase(around_.begin(), around_.begin() + kKept);
      around_.push_back(*next);
      reader_.next();
    }
    return find_pose(around_, time_s);
  }

 private:
  static constexpr std::size_t kKept = 512;  // poses before the time asked for last; a second of physics
  Paths::Reader reader_;
  std::vector<contact::Pose> around_;
};

/// What an event pushes by; a piece of a pulse counts as one.
std::optional<stream::Impulse> find_impulse(const stream::Event& event) {
  if (const auto* impulse = std::get_if<stream::Impulse>(&event)) return *impulse;
  const auto* force = std::get_if<stream::Force>(&event);
  if (force == nullptr) return std::nullopt;
  stream::Impulse impulse = stream::to_impulse(*force);
  impulse.duration_s = force->calc_length_s();
  return impulse;
}

Vec3 find_contact_point(const bank::Bank& bank, const contact::Impulse& impulse) {
  Vec3 point{};
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

/// What supports take of a body's modes, as a member of a JSON object with its comma; empty without losses.
std::string make_mounting_json(const Mounting& mounting) {
  if (mounting.text.empty()) return {};
  std::string json = fmt::format("\"supports\": {{\"text\": {}, \"beyond_first_order\": {}, \"shared\": {}",
                                 base::quote(base::printable(mounting.text)), mounting.beyond, mounting.mixed);
  const auto add = [&](const char* name, const std::vector<double>& values) {
    fmt::format_to(std::back_inserter(json), ",\n    \"{}\": [", name);
    for (std::size_t i = 0; i < values.size(); ++i) fmt::format_to(std::back_inserter(json), "{}{:.8g}", i == 0 ? "" : ", ", values[i]);
    json += "]";
  };
  add("frequencies_hz", mounting.freq_hz);
  add("decay_before_per_s", mounting.decay_before_per_s);
  add("decay_per_s", mounting.decay_per_s);
  return json + "},\n   ";
}

/// As a member of a JSON object with its comma; empty where there are none.
std::string make_limited_json(const radiation::Limited& limited) {
  if (limited.modes == 0) return {};
  return fmt::format("\"limited_gains\": {{\"modes\": {}, \"most_db\": {:.4g}}},\n   ", limited.modes, limited.most_db);
}

}  // namespace

std::string describe_limited(const SceneBody& body) {
  if (body.limited.modes == 0) return {};
  return fmt::format("{} of {} modes would radiate more than their damping takes: softer by up to {:.1f} dB", body.limited.modes,
                     body.spec.bank->mode_count(), body.limited.most_db);
}

void write_trajectory(const Scene& scene, const std::vector<const bank::Bank*>& banks, const Events& events, base::Spool spool,
                      const std::function<void(std::string_view)>& sink) {
  const Paths paths = collect_paths(banks, events, std::move(spool));
  std::string json = "{\n \"bodies\": [";
  auto out = std::back_inserter(json);
  const auto hand_on = [&](std::size_t least) {
    if (json.size() < least) return;
    sink(json);
    json.clear();
  };
  for (std::size_t i = 0; i < scene.bodies.size(); ++i) {
    const SceneBody& body = scene.bodies[i];
    fmt::format_to(out, "{}\n  {{\"name\": {}, \"bank\": {}, \"fixed\": {},\n   \"poses\": [", i == 0 ? "" : ",", base::quote(body.name),
                   base::quote(body.bank.string()), body.spec.fixed);
    bool first = true;
    for_kept_poses(paths, i, [&](const contact::Pose& p) {
      fmt::format_to(out, "{}\n    [{:.6f}, {:.7g}, {:.7g}, {:.7g}, {:.7g}, {:.7g}, {:.7g}, {:.7g}]", first ? "" : ",", p.time_s,
                     p.position_m[0], p.position_m[1], p.position_m[2], p.rotation[0], p.rotation[1], p.rotation[2], p.rotation[3]);
      first = false;
      hand_on(kPiece);
    });
    json += "\n   ]}";
  }
  fmt::format_to(out, "\n ],\n \"ground\": {{\"height_m\": {}}},\n \"up\": \"z\",\n \"impulses\": [",
                 scene.ground ? fmt::format("{:.9g}", scene.ground->height_m) : "null");
  std::vector<PathCursor> cursors;
  for (std::size_t i = 0; i < scene.bodies.size(); ++i) cursors.emplace_back(paths, i);
  bool first = true;
  events.for_each([&](const stream::Event& event) {
    const std::optional<stream::Impulse> impulse = find_impulse(event);
    if (!impulse || impulse->body < 0 || static_cast<std::size_t>(impulse->body) >= scene.bodies.size()) return;
    const auto i = static_cast<std::size_t>(impulse->body);
    const contact::Pose pose = cursors[i].is_empty() ? scene.bodies[i].spec.initial : cursors[i].find(impulse->time_s);
    const Vec3 x = calc_world_point(pose, find_contact_point(*banks[i], *impulse));
    const double size = std::hypot(impulse->impulse_n_s[0], impulse->impulse_n_s[1], impulse->impulse_n_s[2]);
    fmt::format_to(out,
                   "{}\n  {{\"time_s\": {:.9f}, \"body\": {}, \"other\": {}, \"world_m\": [{:.6g}, {:.6g}, {:.6g}], \"impulse_n_s\": "
                   "{:.6g}, \"duration_s\": {:.6g}}}",
                   first ? "" : ",", impulse->time_s, impulse->body, impulse->other, x[0], x[1], x[2], size, impulse->duration_s);
    first = false;
    hand_on(kPiece);
  });
  json += "\n ]\n}\n";
  hand_on(0);
}

std::string make_report_json(const Scene& scene, const Sound& sound, const Plan& plan, const Figures& f) {
  std::string json = "{\n";
  auto out = std::back_inserter(json);
  fmt::format_to(out, " \"scene\": {},\n \"duration_s\": {},\n \"sample_rate_hz\": {},\n \"samples\": {},\n \"channels\": {},\n",
                 base::quote(scene.file.string()), scene.duration_s, sound.rate_hz, sound.frames, sound.channels);
  fmt::format_to(
      out,
      " \"instructions\": \"{}\",\n \"bodies\": {},\n \"modes\": {},\n \"contacts\": {},\n \"impulses\": {},\n \"impulses_played\": {},\n "
      "\"impulses_refused\": {},\n \"resets\": {},\n",
      synth::get_name(synth::get_kernels(scene.quality.instructions).isa), f.bodies, f.modes, f.tally.contacts, f.tally.impulses,
      sound.strikes, sound.refused, sound.resets);
  fmt::format_to(out,
                 " \"physics_steps\": {},\n \"physics_s\": {:.4f},\n \"physics_cpu_s\": {:.5f},\n \"sound_s\": {:.4f},\n \"sound_cpu_s\": "
                 "{:.5f},\n \"playing_cpu_s\": {:.6f},\n "
                 "\"real_time_factor\": {:.4f},\n",
                 f.physics_steps, f.physics_s, f.physics_cpu_s, f.sound_s, sound.seconds_cpu, sound.seconds_playing_cpu,
                 f.real_time_factor);
  fmt::format_to(
      out,
      " \"peak_pa\": {:.6g},\n \"mean_db_spl\": {},\n \"loudest_db_spl\": {},\n \"gain_per_pa\": {:.6g},\n \"gain_reduced\": {},\n"
      " \"faded_end_s\": {:.6g},\n",
      sound.peak_pa, make_level(sound.levels.mean_db), make_level(sound.levels.loudest_db), f.gain.per_pa, f.gain.reduced, sound.faded_s);
  if (f.audit) {
    const contact::EnergyAudit& bodies = f.audit->bodies;
    fmt::format_to(out,
                   " \"energy\": {{\"rise_j\": {:.6g}, \"hit_rise_j\": {:.6g}, \"largest_kinetic_j\": {:.6g}, \"weight_n\": {:.6g}, "
                   "\"modes_rise\": {:.6g},\n  \"start_j\": {:.9g}, \"motion_j\": {:.9g}, \"modes_j\": {:.6g}, \"most_modes_j\": {:.6g}, "
                   "\"modes_share\": {:.6g}, "
                   "\"lost_j\": {:.9g}, \"difference_j\": {:.6g}, \"radiated_j\": {:.6g}}},\n",
                   bodies.rise_j, bodies.hit_rise_j, bodies.kinetic_j, bodies.weight_n, f.audit->modes_rise, bodies.start_j,
                   bodies.motion_j, bodies.modes_j, bodies.most_modes_j, bodies.modes_share, bodies.lost_j, bodies.error_j,
                   f.audit->radiated_j);
  }
  if (!f.blows.empty()) {
    json += " \"mallets\": [";
    for (std::size_t i = 0; i < f.blows.size(); ++i) {
      const Blow& b = f.blows[i];
      fmt::format_to(out,
                     "{}\n  {{\"body\": {}, \"time_s\": {:.9g}, \"contact_s\": {:.6g}, \"impulse_n_s\": {:.6g}, \"peak_n\": {:.6g}, "
                     "\"restitution\": {:.6g}, \"before_j\": {:.6g}, \"after_j\": {:.6g}, \"together\": {}, \"motion_j\": {:.6g}, "
                     "\"modes_j\": {:.6g}, \"lost_j\": {:.6g}}}",
                     i == 0 ? "" : ",", base::quote(b.body), b.time_s, b.contact_s, b.impulse_n_s, b.peak_n, b.restitution, b.before_j,
                     b.after_j, b.together, b.motion_j, b.modes_j, b.lost_j);
    }
    json += "\n ],\n";
  }
  json += " \"warnings\": [";
  for (std::size_t i = 0; i < scene.warnings.size(); ++i) json += (i == 0 ? "" : ", ") + base::quote(base::printable(scene.warnings[i]));
  json += "],\n \"per_body\": [";
  for (std::size_t i = 0; i < scene.bodies.size(); ++i) {
    const std::int64_t played = i < f.tally.body_impulses.size() ? f.tally.body_impulses[i] : 0;
    fmt::format_to(out, "{}\n  {{\"name\": {}, \"modes\": {}, \"impulses\": {}, \"peak_pa_at_1m\": {:.6g},\n   {}{}\"effects\": {}}}",
                   i == 0 ? "" : ",", base::quote(scene.bodies[i].name), sound.body_modes[i], played, sound.body_peak_pa[i],
                   make_mounting_json(scene.bodies[i].mounting), make_limited_json(scene.bodies[i].limited),
                   plan::make_plan_json(plan.planner, plan.facts, static_cast<int>(i), list_measured(sound, i, scene.duration_s)));
  }
  fmt::format_to(out, "\n ],\n \"changes\": {}\n}}\n", plan::make_changes_json(plan.changes, plan.facts, kMostReported));
  return json;
}

}  // namespace carillon::host
