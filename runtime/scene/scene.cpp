#include "runtime/scene/scene.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <span>
#include <utility>

#include "runtime/acoustics/head/sphere.hpp"
#include "runtime/base/document.hpp"
#include "runtime/base/vector.hpp"
#include "runtime/material/solids.hpp"
#include "runtime/scene/scene_bodies.hpp"

namespace carillon::scene {
namespace {

using base::kAboveZero;
using base::Limits;
using base::required;
using base::within;

const base::Keys<physics::JointSpec> kJoint{
    {"kind", &physics::JointSpec::kind, kJointNames,
     "`hinge` turns about `axis`; `ball` turns every way; `slider` moves along `axis`; `universal` turns about `axis`, fixed in `to`, and "
     "`second_axis`, fixed in `body`; `weld` makes one body of two",
     base::required},
    {"body", "required", "name of a moving body"},
    {"to", "required", "name of another body, or `\"world\"`; a `fixed` body counts as the world"},
    {"at_m", &physics::JointSpec::at_m, base::within(kFarthestM), "position of the joint", base::required},
    {"axis", "required for hinge, slider, universal", "direction, of any length"},
    {"second_axis", "required for universal", "at right angles to `axis`"},
    {"damping", &physics::JointSpec::damping, base::Limits{0, 1e6},
     "moment per angular speed [N m s], of a slider force per speed [N s/m]"},
    {"limits_deg", "none", "of a hinge: `[lowest, highest]` rotation of `body` against `to` from the start, within 175 degrees"},
    {"limits_m", "none", "of a slider: `[lowest, highest]` displacement along `axis` from the start"},
    {"stop_restitution", &physics::JointSpec::stop_restitution, base::Limits{0, 1}, "rebound at a limit"}};
const base::Keys<physics::CordSpec> kCord{
    {"from", "required", "end on a body: `{\"body\": name, \"at_m\": [x, y, z]}`"},
    {"to", "required", "the same, or only `at_m`: a point of the world"},
    {"length_m", &physics::CordSpec::length_m, base::kAboveZero, "at least the initial distance of the ends; by default taut at the start"},
    {"restitution", &physics::CordSpec::restitution, base::Limits{0, 1}, "rebound when it becomes taut"}};

/// Index of a body, or -1 for "world".
int find_end(base::Object& object, const Names& bodies, std::string_view key) {
  if (object.string(key) == "world") return -1;
  return static_cast<int>(find_body(object, bodies, key));
}

physics::JointSpec read_joint(base::Object& object, const Names& names) {
  physics::JointSpec joint;
  joint.place = object.find_place("");
  kJoint.read(object, joint);
  const std::string& kind = kJointNames[static_cast<std::size_t>(joint.kind)];
  joint.body = static_cast<int>(find_body(object, names));
  joint.to = find_end(object, names, "to");
  const bool has_axis = joint.kind == joints::Kind::kHinge || joint.kind == joints::Kind::kSlider || joint.kind == joints::Kind::kUniversal;
  if (has_axis) joint.axis = read_direction(object, "axis");
  if (!has_axis && object.has("axis")) object.fail("axis", fmt::format("a {} has none; remove it", kind));
  if (joint.kind == joints::Kind::kUniversal) {
    joint.second_axis = read_direction(object, "second_axis");
    const double cosine = dot(joint.axis, joint.second_axis);
    if (!(std::abs(cosine) < 1e-3)) object.fail("second_axis", "must be at right angles to \"axis\"");
    joint.second_axis = normalise(joint.second_axis - cosine * joint.axis);
  } else if (object.has("second_axis")) {
    object.fail("second_axis", "is for universal joints only; remove it");
  }
  if (joint.kind == joints::Kind::kWeld && object.has("damping")) object.fail("damping", "a weld does not move; remove it");
  const bool turns = joint.kind == joints::Kind::kHinge, slides = joint.kind == joints::Kind::kSlider;
  for (const auto& [key, is_meant] : {std::pair{"limits_deg", turns}, {"limits_m", slides}}) {
    if (!object.has(key)) continue;
    if (!is_meant) object.fail(key, fmt::format("a {} has none; a hinge has \"limits_deg\", a slider \"limits_m\"", kind));
    std::array<double, 2> limits = object.numbers<2>(key);
    const double max = turns ? physics::kWidestHingeDeg : kFarthestM;
    if (!(limits[0] <= 0.0 && limits[1] >= 0.0 && limits[0] >= -max && limits[1] <= max && limits[1] - limits[0] > 1e-3))
      object.fail(key, fmt::format("must be [lowest, highest] with the start, 0, between them, within {:g}", max));
    for (double& limit : limits) limit *= turns ? std::numbers::pi / 180.0 : 1.0;
    joint.limits = limits;
  }
  if (!joint.limits && object.has("stop_restitution"))
    object.fail("stop_restitution", "needs \"limits_deg\" or \"limits_m\"; give them, too");
  object.finish();
  return joint;
}

physics::CordSpec read_cord(base::Object& object, const Names& names) {
  physics::CordSpec cord;
  cord.place = object.find_place("");
  base::Object from = object.object("from"), to = object.object("to");
  cord.body = static_cast<int>(find_body(from, names));
  cord.from_m = read_required_vector(from, "at_m");
  from.finish();
  cord.to = to.has("body") ? find_end(to, names, "body") : -1;
  cord.to_m = read_required_vector(to, "at_m");
  to.finish();
  kCord.read(object, cord);
  const double distance_m = norm(cord.from_m - cord.to_m);
  if (cord.length_m && !(*cord.length_m >= distance_m - 1e-9 && *cord.length_m <= kFarthestM))
    object.fail("length_m", fmt::format("{:g} m is less than the initial distance of its ends, {:.6g} m (or more than {:g} m); give at "
                                        "least that, or leave it out",
                                        *cord.length_m, distance_m, kFarthestM));
  object.finish();
  return cord;
}

/// Reads the keys "joints" and "cords" of a scene. Throws InputError "file:line: ...".
void parse_joints(base::Object& root, const Names& names, Scene& scene) {
  for (base::Object& object : root.objects("joints")) scene.joints.push_back(read_joint(object, names));
  for (base::Object& object : root.objects("cords")) scene.cords.push_back(read_cord(object, names));
}

/// Appends the tables "joint" and "cord" of the reference.
void describe_joint_keys(std::vector<base::KeyTable>& tables) {
  kJoint.describe(tables.emplace_back(base::KeyTable{"joint", {}}));
  kCord.describe(tables.emplace_back(base::KeyTable{"cord", {}}));
}

constexpr double kHeadWidthM = 2.0 * head::Sphere{}.radius_m;
constexpr double kMinHeadM = 2.0 * head::kMinRadiusM, kMaxHeadM = 2.0 * head::kMaxRadiusM;
constexpr std::size_t kMaxWaypoints = 100000;
constexpr std::size_t kMaxMicrophones = 16;

const base::Keys<Scene> kScene{
    {"duration_s", &Scene::duration_s, Limits{1e-3, kLongestS}, "length of the simulation and of the sound", required},
    {"sample_rate_hz", &Scene::sample_rate_hz, Limits{8000, 192000}, "modes at or above half of it are silent; `--rate` overrides it"},
    {"gravity_m_s2", &Scene::gravity_m_s2, within(1e4), "acceleration of gravity"},
    {"ground", "none", "hard floor with the keys below"},
    {"bodies", "required", "1 to 1000 bodies"},
    {"variation", &Scene::variation, Limits{0, 1}, "variation of equal strikes ([Strikes](#strikes))"},
    {"joints", "none", "hinges, ball joints, sliders ([joints](hear-a-scene.md#joints-and-cords))"},
    {"cords", "none", "strings ([joints](hear-a-scene.md#joints-and-cords))"},
    {"strikes", "none", "blows in addition to those of the physics"},
    {"sensors", "none", "accelerometers, strain gauges ([Sensors](#sensors))"},
    {"sensor_rate_hz", &Scene::sensor_rate_hz, Limits{50, 192000}, "of all sensors, by default `sample_rate_hz`"},
    {"listener", "none", "two ears, with the keys below"},
    {"microphones", "none", "replaces `listener`: 1 to 16 positions `[x, y, z]`, one per channel"},
    {"effects", "`\"auto\"`", "chosen automatically; a list: exactly these; `{\"on\": [...], \"off\": [...]}` ([Effects](#effects))"},
    {"radiation", &Scene::radiation, radiation::kGainKindNames, "loudness of modes ([Radiation](#radiation))"},
    {"frequencies", &Scene::frequencies, kFrequenciesNames,
     "without or with the [error of the mesh](../error-bars.md#corrected-frequencies)"},
    {"output", "none", "level and format, with the keys below"},
    {"quality", "none", "accuracy against CPU time ([Quality](#quality))"}};
const base::Keys<physics::GroundSpec> kGround{
    {"height_m", &physics::GroundSpec::height_m, within(kFarthestM), "height of the floor"},
    {"material", "concrete", "name of a [material](materials.md); the next three keys replace its constants"},
    {"young_modulus_pa", &physics::GroundSpec::young_modulus_pa, kAboveZero, "100 to 1e13"},
    {"poisson_ratio", &physics::GroundSpec::poisson_ratio, Limits{-1, 0.5, true}, "Poisson's ratio"},
    {"density_kg_m3", &physics::GroundSpec::density_kg_m3, Limits{1, 3e4}, "density"},
    {"restitution", &physics::GroundSpec::restitution, Limits{0, 1}, "as of a body"},
    {"friction", &physics::GroundSpec::friction, Limits{0, 10}, "as of a body"},
    {"rolling_resistance", &physics::GroundSpec::rolling_resistance, Limits{0, 1}, "as of a body"},
    {"roughness_m", &physics::GroundSpec::roughness_m, Limits{0, kRoughestM}, "as of a body"}};
const base::Keys<Scene> kReflection{{"reflection", &Scene::reflection, Limits{0, 1}, "reflected share of the pressure"}};
const base::Keys<SceneListener> kListener{
    {"position_m", &SceneListener::position_m, within(kFarthestM), "between the ears"},
    {"path", "none", "replaces `position_m`: rows `[t, x, y, z]` in order of time; smooth between, at rest before and after"},
    {"look_at_m", "none", "point to look at"},
    {"facing", "`[0, 1, 0]`", "replaces `look_at_m`: direction"},
    {"ears", &SceneListener::ears, kEarsNames,
     "two points, a head between them ([Heads](#heads)), or [Ambisonics](sound-files.md#ambisonics)"},
    {"order", &SceneListener::order, Limits{1, synth::kMaxAmbisonicOrder}, "of Ambisonics: 4, 9 or 16 channels"},
    {"sofa", "none", "with `\"hrtf\"`: SOFA file of a measured head; without it the head is a rigid sphere"},
    {"ear_distance_m", "0.2", "0 to 10; with `\"hrtf\"` the width of the sphere, 0.175 by default, 0.06 to 0.6"}};
const base::Keys<Output> kOutput{
    {"gain", "`\"auto\"`", "the peak is at `peak_dbfs`; or full scale per pascal, reduced with a warning if it would clip"},
    {"peak_dbfs", &Output::peak_dbfs, Limits{-120, 0}, "peak level"},
    {"format", &Output::format, kSampleFormatNames, "`--format` overrides it; above 4 GiB an RF64"},
    {"fade_end", &Output::fade_end, "fade-out within the last 10 ms if not silent; false for renderings that are added or analysed"}};
const base::Keys<Quality> kQuality{
    {"planner_db", "-50", "an effect is omitted if it changes a body's A-weighted sound by less; -150 to -10. Lower: more effects"},
    {"silence_pa", &Quality::silence_pa, Limits{1e-15, 1},
     "below this pressure at 1 m bodies sleep and modes are dropped, by default as planned, or 1e-10. Lower: modes ring for longer"},
    {"modes", &Quality::modes, Limits{synth::kGroup, std::numeric_limits<std::int32_t>::max()},
     "maximum number of ringing modes; the least audible fade out ([budget](../decisions/budget.md))"},
    {"contact_step_s", &Quality::contact_step_s, Limits{1e-5, 2e-3},
     "maximum time step of the physics during contact; twice that between flat bodies. Shorter: CPU time in inverse proportion. Longer: "
     "rolling and tipping are less exact ([by how much](../decisions/contact.md))"},
    {"joint_tolerance", &Quality::joint_tolerance, Limits{1e-14, 1e-4},
     "error of a step of free motion on joints [rad, m] ([cost](../decisions/joints.md))"},
    {"modes_in_impacts", &Quality::modes_in_impacts,
     "impacts include the modes ([cost](../decisions/impact.md)). False: rigid bodies, given restitution and a Hertz pulse; thin "
     "plates then get too much energy"},
    {"masking", &Quality::masking,
     "omits hits that are masked by earlier ones of the body; inaudible, and 6 to 8 % less CPU time "
     "([figures](../decisions/contact.md)). False by default with `sensors`"},
    {"instructions", &Quality::instructions, kInstructionNames, "instruction set; falls back if unsupported"}};
const base::Keys<effects::SelectionThresholds> kThresholds{
    {"quiet_db", &effects::SelectionThresholds::below_loudest_db, Limits{20, 250},
     "sound this far below the loudest strike so far is inaudible and needs no effects. More: bodies ring for longer"}};

void parse_ground(base::Object& object, Scene& scene) {
  physics::GroundSpec& ground = scene.ground.emplace();
  if (const material::Material* material = read_material(object, ground.young_modulus_pa, ground.poisson_ratio))
    ground.density_kg_m3 = material->density_kg_m3;
  kGround.read(object, ground);
  const auto question = material::ask_about_solid(ground.young_modulus_pa, ground.density_kg_m3);
  if (!(ground.young_modulus_pa >= kSoftestPa && ground.young_modulus_pa <= kStiffestPa)) {
    object.fail("young_modulus_pa", fmt::format("{:g} Pa is not a plausible ground stiffness; give {:g} to {:g}{}", ground.young_modulus_pa,
                                                kSoftestPa, kStiffestPa, question ? ": " + *question : ""));
  }
  if (question) scene.warnings.push_back(fmt::format("{}: \"ground\": {}", object.find_place("young_modulus_pa"), *question));
  kReflection.read(object, scene);
  object.finish();
}

/// A checked position.
Vec3 read_place(const base::Object& object, std::string_view key, std::span<const double> row) {
  for (const double x : row) {
    if (!(std::abs(x) <= kFarthestM)) {
      object.fail(key, fmt::format("{} is out of range; give numbers between {} and {}", x, -kFarthestM, kFarthestM));
    }
  }
  return {row[0], row[1], row[2]};
}

/// Rows [t, x, y, z] in order of time, slower than sound.
std::vector<synth::PathPoint> read_path(base::Object& object, std::string_view key) {
  std::vector<synth::PathPoint> path;
  for (const std::vector<double>& row : object.number_rows(key, 4, kMaxWaypoints)) {
    const synth::PathPoint place{row[0], read_place(object, key, std::span(row).subspan(1))};
    if (!(std::abs(place.time_s) <= kLongestS))
      object.fail(key, fmt::format("time {} is out of range; give {} s at most", row[0], kLongestS));
    if (!path.empty()) {
      const synth::PathPoint& last = path.back();
      if (!(place.time_s > last.time_s)) {
        object.fail(key, fmt::format("time {} follows {}; give rows [t, x, y, z] in order of time", place.time_s, last.time_s));
      }
      const Vec3 &a = last.position_m, &b = place.position_m;
      const double speed = calc_length(b - a) / (place.time_s - last.time_s);
      if (speed > kMaxSpeedMS) {
        object.fail(key, fmt::format("moves at {:.4g} m/s after {} s; give {} m/s at most", speed, last.time_s, kMaxSpeedMS));
      }
    }
    path.push_back(place);
  }
  return path;
}

/// Ears of a listener: free, on a sphere, on a measured head, or Ambisonics.
void parse_ears(base::Object& object, SceneListener& listener) {
  if (listener.ears != Ears::kAmbisonic && object.has("order"))
    object.fail("order", "needs \"ears\": \"ambisonic\"; add that, or leave it out");
  if (listener.ears == Ears::kAmbisonic) {
    for (const char* key : {"sofa", "ear_distance_m"})
      if (object.has(key)) object.fail(key, "Ambisonics have no head; leave it out");
    return;
  }
  if (listener.ears == Ears::kFree) {
    if (object.has("sofa")) object.fail("sofa", "needs \"ears\": \"hrtf\"; add that, or leave it out");
    listener.ear_distance_m = read_within(object, "ear_distance_m", listener.ear_distance_m, 0.0, 10.0);
    return;
  }
  if (object.has("sofa")) {
    listener.sofa = object.path("sofa");
    if (object.has("ear_distance_m")) object.fail("ear_distance_m", "follows from the head in \"sofa\"; leave it out");
    listener.ear_distance_m = kHeadWidthM;
  } else {
    listener.ear_distance_m = read_within(object, "ear_distance_m", kHeadWidthM, kMinHeadM, kMaxHeadM);
  }
}

SceneListener parse_listener(base::Object& object) {
  SceneListener listener;
  kListener.read(object, listener);
  if (object.has("path")) {
    if (object.has("position_m")) object.fail("path", "says the same thing as \"position_m\"; keep one of them");
    listener.path = read_path(object, "path");
    listener.position_m = listener.path.front().position_m;
  }
  parse_ears(object, listener);
  const Vec3 direction = base::read_facing(object, listener.position_m, listener.facing, kFarthestM);
  const double length = norm(direction);
  for (int k = 0; k < 3; ++k) listener.facing[k] = direction[k] / length;
  object.finish();
  return listener;
}

Output parse_output(base::Object& object) {
  Output output;
  if (object.has("gain")) {
    const bool automatic = object.has_string("gain") && object.string("gain") == "auto";
    if (!automatic && !object.has_number("gain")) object.fail("gain", "must be \"auto\" or a number, full scale per pascal");
    if (!automatic) output.gain_per_pa = object.number("gain");
    if (output.gain_per_pa && !(*output.gain_per_pa > 0.0 && *output.gain_per_pa < 1e12)) {
      object.fail("gain", fmt::format("must be greater than 0 and below 1e12, and is {}", *output.gain_per_pa));
    }
  }
  kOutput.read(object, output);
  object.finish();
  return output;
}

Quality parse_quality(base::Object& object, Quality quality) {
  if (object.has("planner_db")) quality.thresholds.audible_share = std::pow(10.0, 0.1 * read_within(object, "planner_db", -150.0, -10.0));
  kThresholds.read(object, quality.thresholds);
  kQuality.read(object, quality);
  object.finish();
  return quality;
}

/// Refuses the effect "head" without a head; with one, it is on for bodies without planning.
void check_head(base::Object& root, Scene& scene) {
  const bool is_wanted = std::any_of(scene.bodies.begin(), scene.bodies.end(),
                                     [](const SceneBody& body) { return body.overrides.on.has(synth::Effect::kHead); });
  if (is_wanted && !has_head(scene))
    root.fail("effects", "names \"head\", and the listener has no head; give it \"ears\": \"hrtf\", or leave \"head\" out");
  if (has_head(scene) && scene.overrides.automatic && !scene.overrides.off.has(synth::Effect::kHead))
    scene.effects = scene.effects.with(synth::Effect::kHead);
}

/// The ground reflects by its own key or by the effect of a body; receivers must be above a reflecting ground.
void check_floor(base::Object& root, Scene& scene) {
  const auto wants = [](const effects::EffectOverrides& overrides) { return overrides.on.has(synth::Effect::kGroundReflection); };
  const bool is_wanted =
      std::any_of(scene.bodies.begin(), scene.bodies.end(), [&](const SceneBody& body) { return wants(body.overrides); });
  if (is_wanted && !scene.ground)
    root.fail("effects", "names \"ground_reflection\", and the scene has no \"ground\"; add one, or leave it out");
  if (is_wanted && !scene.reflection) scene.reflection = 1.0;
  const std::optional<synth::Floor> floor = find_floor(scene);
  if (!floor) return;
  const auto check = [&](const char* key, const Vec3& place) {
    if (floor->calc_height_m(place) < 0.0)
      root.fail(key, fmt::format("is below the reflecting ground, at a height of {:g} m; move it above", place[2]));
  };
  for (const Vec3& place : scene.microphones_m) check("microphones", place);
  if (!scene.microphones_m.empty()) return;
  if (scene.listener.path.empty()) check("listener", scene.listener.position_m);
  for (const synth::PathPoint& point : scene.listener.path) check("listener", point.position_m);
}

}  // namespace

std::optional<synth::Floor> find_floor(const Scene& scene) {
  if (!scene.ground || !scene.reflection) return std::nullopt;
  return synth::Floor{.point_m = {0.0, 0.0, scene.ground->height_m}, .reflection = *scene.reflection};
}

Scene read_scene(const std::filesystem::path& file) {
  return parse_scene(base::read_document(file, fmt::format("a scene may hold {} bodies and {} strikes", kMaxBodies, kMaxStrikes)));
}

Scene parse_scene(const base::Document& document) {
  Scene scene;
  scene.file = document.file();
  base::Object root = document.root();
  kScene.read(root, scene);
  if (auto ground = root.object_if("ground")) parse_ground(*ground, scene);

  if (root.objects("bodies").empty()) {
    kScene.expect(root);
    root.finish();  // a misspelt key is the likeliest reason
    root.fail("bodies", "is missing or empty; list at least one body with a \"name\" and a \"bank\", or a \"recording\"");
  }
  const Names names = parse_bodies(root, scene);
  parse_joints(root, names, scene);
  parse_strikes(root, names, scene);
  parse_sensors(root, names, scene);
  if (auto listener = root.object_if("listener")) scene.listener = parse_listener(*listener);
  if (root.has("microphones")) {
    if (root.has("listener")) root.fail("microphones", "takes the place of \"listener\"; keep one of them");
    for (const std::vector<double>& row : root.number_rows("microphones", 3, kMaxMicrophones)) {
      scene.microphones_m.push_back(read_place(root, "microphones", row));
    }
  }
  for (const SceneSurface& surface : scene.surfaces)
    if (!(surface.start_s < scene.duration_s))
      throw InputError(fmt::format("{}: \"{}\" begins at {} s, and the scene ends at {} s; give a smaller \"start_s\"", surface.place,
                                   surface.name, surface.start_s, scene.duration_s));
  check_head(root, scene);
  check_floor(root, scene);
  if (auto output = root.object_if("output")) scene.output = parse_output(*output);
  scene.quality.masking = scene.sensors.empty();  // hits that are not heard are still read
  if (auto quality = root.object_if("quality")) scene.quality = parse_quality(*quality, scene.quality);
  root.finish();
  return scene;
}

std::vector<base::KeyTable> describe_scene_keys() {
  std::vector<base::KeyTable> tables{{"scene", {}}, {"quality", {}}};
  kScene.describe(tables[0]);
  kGround.describe(tables[0], "ground.");
  kReflection.describe(tables[0], "ground.");
  kListener.describe(tables[0], "listener.");
  kOutput.describe(tables[0], "output.");
  kQuality.describe(tables[1]);
  kThresholds.describe(tables[1]);
  describe_body_keys(tables);
  describe_strike_keys(tables);
  describe_sensor_keys(tables);
  describe_joint_keys(tables);
  return tables;
}

bool has_head(const Scene& scene) { return scene.microphones_m.empty() && scene.listener.ears != Ears::kFree; }

bool has_ambisonics(const Scene& scene) { return scene.microphones_m.empty() && scene.listener.ears == Ears::kAmbisonic; }

std::size_t count_channels(const Scene& scene) {
  if (has_ambisonics(scene)) return synth::count_ambisonic_channels(scene.listener.order);
  return scene.microphones_m.empty() ? 2 : scene.microphones_m.size();
}

std::array<Vec3, 2> calc_ears(const SceneListener& listener) {
  // Left is up x facing, or -x for a listener looking straight up or down.
  Vec3 left{-listener.facing[1], listener.facing[0], 0.0};
  const double length = norm(left);
  left = length > 1e-6 ? Vec3{left[0] / length, left[1] / length, 0.0} : Vec3{-1.0, 0.0, 0.0};
  std::array<Vec3, 2> ears{listener.position_m, listener.position_m};
  for (int k = 0; k < 3; ++k) {
    ears[0][k] += 0.5 * listener.ear_distance_m * left[k];
    ears[1][k] -= 0.5 * listener.ear_distance_m * left[k];
  }
  return ears;
}

}  // namespace carillon::scene
