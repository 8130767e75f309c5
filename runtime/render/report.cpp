#include "runtime/render/report.hpp"

#include <fmt/format.h>

#include <cmath>
#include <optional>

#include "runtime/base/json.hpp"
#include "runtime/base/printable.hpp"
#include "runtime/scene/effects/table.hpp"
#include "runtime/scene/pose.hpp"
#include "runtime/synth/kernels.hpp"

namespace carillon::render {
namespace {

constexpr double kPosesPerS = 200.0;
constexpr std::size_t kPieceBytes = 1 << 16;  // bytes per write

using Paths = base::RecordLists<physics::Pose>;

/// Path of each body. At the time of an impact: the pose before it.
Paths collect_paths(const std::vector<const bank::Bank*>& banks, const scene::Events& events, base::Spool spool) {
  Paths paths(banks.size(), std::move(spool));
  std::vector<std::optional<double>> last_s(banks.size());
  events.for_each([&](const events::Event& event) {
    const auto* motion = std::get_if<events::BodyMotion>(&event);
    if (motion == nullptr || motion->body < 0 || motion->body >= std::ssize(banks)) return;
    const std::size_t body = motion->body;
    if (last_s[body] && *last_s[body] >= motion->time_s) return;
    last_s[body] = motion->time_s;
    paths.append(body, physics::calc_pose(*motion, banks[body]->rigid.centre_m));
  });
  return paths;
}

/// Keeps poses at least 1 / 200 s apart, and the last one, which replaces its predecessor.
template <class Work>
void for_kept_poses(const Paths& paths, std::size_t body, Work&& work) {
  Paths::Reader reader(paths, body);
  std::optional<physics::Pose> waiting, last;  // kept unless replaced by the last pose; most recent
  std::size_t kept = 0;
  double kept_s = 0.0;
  for (const physics::Pose* pose = reader.peek(); pose != nullptr; pose = reader.peek()) {
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

/// Looks up poses at increasing times.
class PathCursor {
 public:
  PathCursor(const Paths& paths, std::size_t body) : reader_(paths, body) {
    const physics::Pose* first = reader_.peek();
    if (first == nullptr) return;
    around_ = {*first};
    reader_.next();
  }
  bool is_empty() const { return around_.empty(); }
  /// find_pose() of the whole path, for nearly monotonic times.
  physics::Pose find(double time_s) {
    while (around_.back().time_s <= time_s) {
      const physics::Pose* next = reader_.peek();
      if (next == nullptr) break;
      if (around_.size() == 2 * kKept) around_.erase(around_.begin(), around_.begin() + kKept);
      around_.push_back(*next);
      reader_.next();
    }
    return scene::find_pose(around_, time_s);
  }

 private:
  static constexpr std::size_t kKept = 512;  // poses kept before the last requested time: one second of physics
  Paths::Reader reader_;
  std::vector<physics::Pose> around_;
};

/// Impulse of an event; pieces of one pulse count as one.
std::optional<events::Impulse> find_impulse(const events::Event& event) {
  if (const auto* impulse = std::get_if<events::Impulse>(&event)) return *impulse;
  const auto* force = std::get_if<events::Force>(&event);
  if (force == nullptr) return std::nullopt;
  events::Impulse impulse = events::to_impulse(*force);
  impulse.duration_s = force->calc_length_s();
  return impulse;
}

Vec3 find_contact_point(const bank::Bank& bank, const physics::Impulse& impulse) {
  Vec3 point{};
  for (int corner = 0; corner < 3; ++corner) {
    const std::size_t vertex = bank.triangles[impulse.triangle][corner];
    for (int k = 0; k < 3; ++k) point[k] += impulse.barycentric[corner] * bank.vertices_m[vertex][k];
  }
  return point;
}

/// Silence has the level null: JSON has no infinity.
base::Json make_level_json(double db) { return base::finite_or_null(db, base::decimals, 2); }

base::Json make_figure(double value, int digits = 6) { return base::finite_or_null(value, base::significant, digits); }

base::Json make_list_json(const std::vector<double>& values) {
  base::Json list = base::Json::array();
  for (const double value : values) list.add(make_figure(value, 8));
  return list;
}

/// Effects of a body, their reasons and their work.
base::Json make_effects_json(const scene::Plan& plan, const Sound& sound, std::size_t body) {
  base::Json json = effects::make_plan_json(plan.selector, static_cast<int>(body));
  for (const synth::Effect effect : synth::EffectSet::all())
    json[synth::get_name(effect)].set("units", sound.effect_counters[body].units[effect]);
  return json;
}

/// Effect of supports on the modes of a body.
base::Json make_mounting_json(const scene::Mounting& mounting) {
  base::Json json = base::Json::object();
  json.set("text", base::printable(mounting.text)).set("beyond_first_order", mounting.beyond).set("shared", mounting.mixed);
  json.set("frequencies_hz", make_list_json(mounting.freq_hz)).set("decay_before_per_s", make_list_json(mounting.decay_before_per_s));
  json.set("decay_per_s", make_list_json(mounting.decay_per_s));
  return json;
}

base::Json make_pair_json(const scene::Scene& scene, int body, int other) {
  const auto name = [&](int i) { return i < 0 ? base::Json() : base::Json(scene.bodies[i].name); };
  return base::Json::object().set("body", name(body)).set("other", name(other));
}

base::Json make_depth_json(const scene::Scene& scene, const physics::Depth& depth) {
  return make_pair_json(scene, depth.body, depth.other)
      .set("depth_m", make_figure(depth.depth_m))
      .set("unexplained_m", make_figure(depth.unexplained_m))
      .set("time_s", make_figure(depth.time_s, 9));
}

base::Json make_rate_json(const scene::Scene& scene, const physics::HitRate& rate) {
  return make_pair_json(scene, rate.body, rate.other).set("hits_per_s", make_figure(rate.per_s)).set("time_s", make_figure(rate.time_s, 9));
}

base::Json make_contacts_json(const scene::Scene& scene, const physics::ContactAudit& contacts) {
  base::Json json = base::Json::object();
  json.set("deepest_now", make_depth_json(scene, contacts.now)).set("deepest", make_depth_json(scene, contacts.deepest));
  json.set("deepest_unexplained", make_depth_json(scene, contacts.unexplained)).set("pushes", contacts.pushes);
  json.set("hits_per_s", make_figure(contacts.hits_per_s)).set("worst_pair", make_rate_json(scene, contacts.worst_pair));
  json.set("busiest_half_second", make_rate_json(scene, contacts.busiest)).set("ended_impacts", contacts.ended_impacts);
  json.set("longest_impact_s", make_figure(contacts.longest_impact_s));
  return json;
}

base::Json make_audit_json(const EnergyBooks& books) {
  const physics::EnergyAudit& bodies = books.bodies;
  base::Json json = base::Json::object();
  json.set("rise_j", make_figure(bodies.rise_j)).set("hit_rise_j", make_figure(bodies.hit_rise_j));
  json.set("largest_kinetic_j", make_figure(bodies.kinetic_j)).set("weight_n", make_figure(bodies.weight_n));
  json.set("modes_rise", make_figure(books.modes_rise)).set("start_j", make_figure(bodies.start_j, 9));
  json.set("motion_j", make_figure(bodies.motion_j, 9)).set("modes_j", make_figure(bodies.modes_j));
  json.set("max_modes_j", make_figure(bodies.max_modes_j)).set("modes_share", make_figure(bodies.modes_share));
  json.set("lost_j", make_figure(bodies.lost_j, 9)).set("lifted_j", make_figure(bodies.lifted_j));
  json.set("difference_j", make_figure(bodies.error_j)).set("modes_given_j", make_figure(books.modes.given_j, 9));
  json.set("modes_held_j", make_figure(books.modes.held_j, 9)).set("modes_lost_j", make_figure(books.modes.lost_j, 9));
  json.set("radiated_j", make_figure(books.modes.radiated_j));
  return json;
}

base::Json make_blow_json(const scene::Blow& blow) {
  base::Json json = base::Json::object();
  json.set("body", blow.body).set("time_s", make_figure(blow.time_s, 9)).set("contact_s", make_figure(blow.contact_s));
  json.set("impulse_n_s", make_figure(blow.impulse_n_s)).set("peak_n", make_figure(blow.peak_n));
  json.set("restitution", make_figure(blow.restitution)).set("before_j", make_figure(blow.before_j));
  json.set("after_j", make_figure(blow.after_j)).set("together", blow.together).set("motion_j", make_figure(blow.motion_j));
  json.set("modes_j", make_figure(blow.modes_j)).set("lost_j", make_figure(blow.lost_j));
  return json;
}

base::Json make_body_json(const scene::Scene& scene, const Sound& sound, const scene::Plan& plan, const Figures& figures, std::size_t i) {
  const scene::SceneBody& body = scene.bodies[i];
  base::Json json = base::Json::object();
  json.set("name", body.name).set("modes", sound.body_modes[i]);
  json.set("impulses", i < figures.tally.body_impulses.size() ? figures.tally.body_impulses[i] : std::int64_t{0});
  json.set("peak_pa_at_1m", make_figure(sound.body_peak_pa[i]));
  if (sound.body_deflection[i] > 0.0) json.set("deflection_thicknesses", make_figure(sound.body_deflection[i], 4));
  if (!body.mounting.text.empty()) json.set("supports", make_mounting_json(body.mounting));
  if (body.limited.modes != 0) json["limited_gains"].set("modes", body.limited.modes).set("max_db", make_figure(body.limited.max_db, 4));
  json.set("effects", make_effects_json(plan, sound, i));
  return json;
}

/// [time_s, x, y, z, w, x, y, z]
base::Json describe_pose(const physics::Pose& pose) {
  base::Json json = base::Json::array();
  json.add(base::decimals(pose.time_s, 6));
  for (const double x : pose.position_m) json.add(base::significant(x, 7));
  for (const double x : pose.rotation) json.add(base::significant(x, 7));
  return json;
}

base::Json describe_impulse(const events::Impulse& impulse, const Vec3& world_m) {
  base::Json place = base::Json::array();
  for (const double x : world_m) place.add(base::significant(x, 6));
  base::Json json = base::Json::object();
  json.set("time_s", base::decimals(impulse.time_s, 9)).set("body", impulse.body).set("other", impulse.other).set("world_m", place);
  json.set("impulse_n_s", base::significant(calc_length(impulse.impulse_n_s), 6));
  json.set("duration_s", base::significant(impulse.duration_s, 6));
  return json;
}

/// Streams a JSON object with long lists to a sink in pieces; memory does not grow with their lengths. Tracks the open objects and lists;
/// one line per member and element.
class JsonPieces {
 public:
  explicit JsonPieces(const std::function<void(std::string_view)>& sink) : sink_(&sink) { open('{', '}'); }

  void set(std::string_view key, const base::Json& value) {
    place(base::quote(key) + ": ");
    json_ += value.line();
  }
  void add(const base::Json& value) {
    place("");
    json_ += value.line();
  }
  void begin_list(std::string_view key) {
    place(base::quote(key) + ": ");
    open('[', ']');
  }
  void begin_object() {
    place("");
    open('{', '}');
  }
  /// of the innermost open object or list
  void end() {
    const Level level = levels_.back();
    levels_.pop_back();
    if (!level.is_empty) start_line();
    json_ += level.end;
    if (!levels_.empty()) return;
    json_ += '\n';
    flush();
  }

 private:
  struct Level {
    char end = '}';
    bool is_empty = true;
  };

  void open(char begin, char end) {
    json_ += begin;
    levels_.push_back({end});
  }
  void place(std::string_view key) {
    if (json_.size() >= kPieceBytes) flush();
    if (!std::exchange(levels_.back().is_empty, false)) json_ += ',';
    start_line();
    json_ += key;
  }
  void start_line() {
    json_ += '\n';
    json_.append(levels_.size(), ' ');
  }
  void flush() {
    (*sink_)(json_);
    json_.clear();
  }

  const std::function<void(std::string_view)>* sink_;
  std::string json_;
  std::vector<Level> levels_;
};

}  // namespace

EnergyBooks make_books(const scene::Scene& scene, const physics::EnergyAudit& physics, const Sound& sound) {
  EnergyBooks books{physics, sound.energy_rise, sound.mode_energy};
  const double more_j = std::max(0.0, books.modes.held_j - physics.modes_j);
  books.bodies.modes_j += more_j;
  if (scene.strikes.empty() && physics.start_j != 0.0) books.bodies.lost_j -= more_j;
  books.bodies.max_modes_j = std::max(physics.max_modes_j, sound.max_modes_j);
  return books;
}

std::string describe_pair(const scene::Scene& scene, int body, int other) {
  if (body < 0) return "none";
  const auto name = [&](int i) { return "'" + base::printable(scene.bodies[i].name) + "'"; };
  return fmt::format("{} and {}", name(body), other < 0 ? "the ground" : name(other));
}

std::vector<std::string> list_contact_warnings(const scene::Scene& scene, const physics::ContactAudit& contacts,
                                               const physics::EnergyAudit& energy) {
  constexpr double kMaxLifted = 0.01;  // share of the largest kinetic energy
  constexpr double kMaxHits = 500.0;   // per second and pair of bodies, over half a second
  std::vector<std::string> warnings;
  if (const physics::Depth& d = contacts.unexplained; d.calc_excess() > 1.0)
    warnings.push_back(fmt::format(
        "{} were {:.3g} mm inside each other at {:.4g} s, more than their impacts explain (0.1 mm, or 5 % of the thickness, are right)",
        describe_pair(scene, d.body, d.other), 1e3 * d.unexplained_m, d.time_s));
  if (energy.lifted_j > kMaxLifted * energy.kinetic_j)
    warnings.push_back(fmt::format("bodies that were moved apart gained {:.3g} J, {:.2g} % of the largest kinetic energy", energy.lifted_j,
                                   100.0 * energy.lifted_j / energy.kinetic_j));
  if (const physics::HitRate& r = contacts.busiest; r.per_s > kMaxHits)
    warnings.push_back(
        fmt::format("{} struck each other {:.0f} times a second in the half second before {:.4g} s: they rattle, or should rest",
                    describe_pair(scene, r.body, r.other), r.per_s, r.time_s));
  return warnings;
}

std::string describe_limited(const scene::SceneBody& body) {
  if (body.limited.modes == 0) return {};
  return fmt::format("{} of {} modes would radiate more than their damping takes: softer by up to {:.1f} dB", body.limited.modes,
                     body.spec.bank->mode_count(), body.limited.max_db);
}

void write_trajectory(const scene::Scene& scene, const std::vector<const bank::Bank*>& banks, const scene::Events& events,
                      base::Spool spool, const std::function<void(std::string_view)>& sink) {
  const Paths paths = collect_paths(banks, events, std::move(spool));
  JsonPieces json(sink);
  json.begin_list("bodies");
  for (std::size_t i = 0; i < scene.bodies.size(); ++i) {
    const scene::SceneBody& body = scene.bodies[i];
    json.begin_object();
    json.set("name", body.name);
    json.set("bank", body.bank.string());
    json.set("fixed", body.spec.fixed);
    json.begin_list("poses");
    for_kept_poses(paths, i, [&](const physics::Pose& pose) { json.add(describe_pose(pose)); });
    json.end();
    json.end();
  }
  json.end();
  const base::Json height = scene.ground ? make_figure(scene.ground->height_m, 9) : base::Json();
  json.set("ground", base::Json::object().set("height_m", height));
  json.set("up", "z");
  json.begin_list("impulses");
  std::vector<PathCursor> cursors;
  for (std::size_t i = 0; i < scene.bodies.size(); ++i) cursors.emplace_back(paths, i);
  events.for_each([&](const events::Event& event) {
    const std::optional<events::Impulse> impulse = find_impulse(event);
    if (!impulse || impulse->body < 0 || impulse->body >= std::ssize(scene.bodies)) return;
    const std::size_t i = impulse->body;
    const physics::Pose pose = cursors[i].is_empty() ? scene.bodies[i].spec.initial : cursors[i].find(impulse->time_s);
    json.add(describe_impulse(*impulse, scene::calc_world_point(pose, find_contact_point(*banks[i], *impulse))));
  });
  json.end();
  json.end();
}

std::string make_report_json(const scene::Scene& scene, const Sound& sound, const scene::Plan& plan, const Figures& f) {
  base::Json json = base::Json::object();
  json.set("scene", scene.file.string()).set("duration_s", scene.duration_s).set("sample_rate_hz", sound.rate_hz);
  json.set("samples", sound.frames).set("channels", sound.channels);
  json.set("instructions", synth::get_name(synth::get_kernels(scene.quality.instructions).isa)).set("bodies", f.bodies);
  json.set("modes", f.modes).set("contacts", f.tally.contacts).set("impulses", f.tally.impulses).set("impulses_played", sound.strikes);
  json.set("impulses_refused", sound.refused + sound.faults).set("resets", sound.resets).set("physics_steps", f.physics_steps);
  json.set("physics_s", base::decimals(f.physics_s, 4)).set("physics_cpu_s", base::decimals(f.physics_cpu_s, 5));
  json.set("sound_s", base::decimals(f.sound_s, 4)).set("sound_cpu_s", base::decimals(sound.seconds_cpu, 5));
  json.set("playing_cpu_s", base::decimals(sound.seconds_playing_cpu, 6)).set("real_time_factor", base::decimals(f.real_time_factor, 4));
  json.set("peak_pa", make_figure(sound.peak_pa)).set("mean_db_spl", make_level_json(sound.levels.mean_db));
  json.set("loudest_db_spl", make_level_json(sound.levels.loudest_db)).set("gain_per_pa", make_figure(f.gain.per_pa));
  json.set("gain_reduced", f.gain.reduced).set("faded_end_s", make_figure(sound.faded_s));
  if (f.audit) json.set("energy", make_audit_json(*f.audit));
  if (f.audit) json.set("depth_and_hits", make_contacts_json(scene, f.contacts));
  for (const scene::Blow& blow : f.blows) json["mallets"].add(make_blow_json(blow));
  base::Json warnings = base::Json::array(), bodies = base::Json::array();
  for (const std::string& warning : scene.warnings) warnings.add(base::printable(warning));
  for (std::size_t i = 0; i < scene.bodies.size(); ++i) bodies.add(make_body_json(scene, sound, plan, f, i));
  json.set("warnings", warnings).set("per_body", bodies);
  for (std::size_t i = 0; i < scene.surfaces.size(); ++i)
    json["recordings"].add(make_surface_json(scene, scene.surfaces[i], sound.surfaces[i]));
  return json.text();
}

}  // namespace carillon::render
