#include "runtime/scene/scene.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <span>
#include <utility>

#include "runtime/acoustics/head/sphere.hpp"
#include "runtime/scene/scene_bodies.hpp"
#include "runtime/scene/scene_joints.hpp"
#include "runtime/scene/scene_strikes.hpp"
#include "runtime/scene/scene_values.hpp"
#include "runtime/material/solids.hpp"

namespace carillon::scene {
namespace {

constexpr double kShortestS = 1e-3;
constexpr double kMaxEarDistanceM = 10.0;
constexpr double kHeadWidthM = 2.0 * head::Sphere{}.radius_m;
constexpr double kNarrowestHeadM = 2.0 * head::kMinRadiusM, kWidestHeadM = 2.0 * head::kMaxRadiusM;
constexpr std::size_t kMaxWaypoints = 100000;
constexpr std::size_t kMaxMicrophones = 16;

physics::GroundSpec parse_ground(base::Object& object, std::optional<double>& reflection, std::vector<std::string>& warnings) {
  physics::GroundSpec ground;
  if (const material::Material* material = read_material(object, ground.young_modulus_pa, ground.poisson_ratio))
    ground.density_kg_m3 = material->density_kg_m3;
  ground.height_m = read_within(object, "height_m", ground.height_m, -kFarthestM, kFarthestM);
  ground.young_modulus_pa = object.number_or("young_modulus_pa", ground.young_modulus_pa, base::kPositive);
  ground.density_kg_m3 = read_within(object, "density_kg_m3", ground.density_kg_m3, 1.0, 3e4);
  const auto question = material::ask_about_solid(ground.young_modulus_pa, ground.density_kg_m3);
  if (!(ground.young_modulus_pa >= kSoftestPa && ground.young_modulus_pa <= kStiffestPa)) {
    object.fail("young_modulus_pa", fmt::format("{:g} Pa is no plausible ground stiffness; give {:g} to {:g}{}", ground.young_modulus_pa,
                                                kSoftestPa, kStiffestPa, question ? ": " + *question : ""));
  }
  if (question) warnings.push_back(fmt::format("{}: \"ground\": {}", object.find_place("young_modulus_pa"), *question));
  ground.poisson_ratio = object.number_or("poisson_ratio", ground.poisson_ratio, {-1.0, 0.5});
  ground.restitution = read_within(object, "restitution", ground.restitution, 0.0, 1.0);
  ground.friction = read_within(object, "friction", ground.friction, 0.0, 10.0);
  ground.roughness_m = read_within(object, "roughness_m", ground.roughness_m, 0.0, kRoughestM);
  if (object.has("reflection")) reflection = read_within(object, "reflection", 1.0, 0.0, 1.0);
  object.finish();
  return ground;
}

/// A place in the world by a row of numbers.
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
      const double speed = std::hypot(b[0] - a[0], b[1] - a[1], b[2] - a[2]) / (place.time_s - last.time_s);
      if (speed > kMaxSpeedMs) {
        object.fail(key, fmt::format("moves at {:.4g} m/s after {} s; give {} m/s at most", speed, last.time_s, kMaxSpeedMs));
      }
    }
    path.push_back(place);
  }
  return path;
}

/// The index of the name at `key`.
std::size_t read_name(base::Object& object, std::string_view key, const std::vector<std::string>& names, const std::string& fallback) {
  const std::string name = object.choice_or(key, names, fallback);
  return std::find(names.begin(), names.end(), name) - names.begin();
}

/// The ears of a listener: free, on a sphere or on a measured head.
void parse_ears(base::Object& object, SceneListener& listener) {
  listener.ears = static_cast<Ears>(read_name(object, "ears", kEarsNames, "free"));
  if (listener.ears == Ears::kFree) {
    if (object.has("sofa")) object.fail("sofa", "is a head's file; it goes with \"ears\": \"hrtf\", or leave it out");
    listener.ear_distance_m = read_within(object, "ear_distance_m", listener.ear_distance_m, 0.0, kMaxEarDistanceM);
    return;
  }
  if (object.has("sofa")) {
    listener.sofa = object.path("sofa");
    if (object.has("ear_distance_m")) object.fail("ear_distance_m", "is that of the head in \"sofa\"; leave it out");
    listener.ear_distance_m = kHeadWidthM;
  } else {
    listener.ear_distance_m = read_within(object, "ear_distance_m", kHeadWidthM, kNarrowestHeadM, kWidestHeadM);
  }
}

SceneListener parse_listener(base::Object& object) {
  SceneListener listener;
  if (object.has("path")) {
    if (object.has("position_m")) object.fail("path", "says the same thing as \"position_m\"; keep one of them");
    listener.path = read_path(object, "path");
    listener.position_m = listener.path.front().position_m;
  } else {
    listener.position_m = read_vector(object, "position_m", listener.position_m, kFarthestM);
  }
  parse_ears(object, listener);
  Vec3 direction = listener.facing;
  std::string key = "facing";
  if (object.has("look_at_m")) {
    if (object.has("facing")) object.fail("look_at_m", "says the same thing as \"facing\"; keep one of them");
    key = "look_at_m";
    const Vec3 target = read_vector(object, key, {0.0, 0.0, 0.0}, kFarthestM);
    for (int k = 0; k < 3; ++k) direction[k] = target[k] - listener.position_m[k];
  } else {
    direction = read_vector(object, key, direction, kFarthestM);
  }
  const double length = norm(direction);
  if (!(length > 1e-9)) object.fail(key, "gives the listener no direction to look in; name another place or direction");
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
      object.fail("gain", fmt::format("{}, and is {}", "must be greater than 0 and below 1e12", *output.gain_per_pa));
    }
  }
  output.peak_dbfs = read_within(object, "peak_dbfs", output.peak_dbfs, -120.0, 0.0);
  output.format = static_cast<SampleFormat>(read_name(object, "format", kSampleFormatNames, "pcm24"));
  output.fade_end = object.boolean_or("fade_end", output.fade_end);
  object.finish();
  return output;
}

Quality parse_quality(base::Object& object) {
  Quality quality;
  effects::SelectionThresholds& thresholds = quality.thresholds;
  if (object.has("planner_db")) thresholds.audible_share = std::pow(10.0, 0.1 * read_within(object, "planner_db", 0.0, -150.0, -10.0));
  thresholds.below_loudest_db = read_within(object, "quiet_db", thresholds.below_loudest_db, 20.0, 250.0);
  if (object.has("silence_pa")) quality.silence_pa = read_within(object, "silence_pa", 0.0, 1e-15, 1.0);
  quality.modes = object.integer_if("modes", synth::kGroup, std::numeric_limits<std::int32_t>::max());
  quality.contact_step_s = read_within(object, "contact_step_s", quality.contact_step_s, 1e-5, 2e-3);
  quality.joint_tolerance = read_within(object, "joint_tolerance", quality.joint_tolerance, 1e-14, 1e-4);
  quality.modes_in_impacts = object.boolean_or("modes_in_impacts", quality.modes_in_impacts);
  quality.masking = object.boolean_or("masking", quality.masking);
  quality.instructions = static_cast<synth::Isa>(read_name(object, "instructions", kInstructionNames, "best"));
  object.finish();
  return quality;
}

/// Refuses the effect "head" without a head; with one, bodies without planned effects have it.
void check_head(base::Object& root, Scene& scene) {
  const bool is_wanted = std::any_of(scene.bodies.begin(), scene.bodies.end(),
                                     [](const SceneBody& body) { return body.overrides.on.has(synth::Effect::kHead); });
  if (is_wanted && !has_head(scene))
    root.fail("effects", "names \"head\", and the listener has none; give it \"ears\": \"hrtf\", or leave \"head\" out");
  if (has_head(scene) && scene.overrides.automatic && !scene.overrides.off.has(synth::Effect::kHead))
    scene.effects = scene.effects.with(synth::Effect::kHead);
}

/// The ground reflects by its own key or by the effect of a body; the listener must be above such a ground.
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
      root.fail(key, fmt::format("is below the ground, which reflects, at a height of {:g} m; put it above", place[2]));
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
  scene.duration_s = root.number("duration_s", base::kPositive);
  if (scene.duration_s < kShortestS || scene.duration_s > kLongestS) {
    root.fail("duration_s", fmt::format("{} is out of range; give {} to {} s", scene.duration_s, kShortestS, kLongestS));
  }
  scene.sample_rate_hz = static_cast<int>(root.integer_if("sample_rate_hz", 8000, 192000).value_or(scene.sample_rate_hz));
  scene.gravity_m_s2 = read_vector(root, "gravity_m_s2", scene.gravity_m_s2, 1e4);
  if (auto ground = root.object_if("ground")) scene.ground = parse_ground(*ground, scene.reflection, scene.warnings);

  const Names names = parse_bodies(root, scene);
  parse_joints(root, names, scene);
  parse_strikes(root, names, scene);
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
  scene.frequencies = static_cast<bank::Frequencies>(read_name(root, "frequencies", kFrequenciesNames, "corrected"));
  scene.radiation = static_cast<radiation::GainKind>(read_name(root, "radiation", radiation::kGainKindNames, "auto"));
  if (auto output = root.object_if("output")) scene.output = parse_output(*output);
  if (auto quality = root.object_if("quality")) scene.quality = parse_quality(*quality);
  root.finish();
  return scene;
}

bool has_head(const Scene& scene) { return scene.microphones_m.empty() && scene.listener.ears == Ears::kHrtf; }

std::size_t count_channels(const Scene& scene) { return scene.microphones_m.empty() ? 2 : scene.microphones_m.size(); }

std::array<Vec3, 2> calc_ears(const SceneListener& listener) {
  // Left is up x facing; for a listener who looks straight up or down it is -x.
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
