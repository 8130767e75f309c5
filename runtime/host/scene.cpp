#include "runtime/host/scene.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>

namespace carillon::host {
namespace {

constexpr double kShortestS = 1e-3;
constexpr double kLongestS = 3600.0;
constexpr double kFarthestM = 1e4;  // of positions; sound takes half a minute from there
constexpr std::size_t kMostBodies = 1000;
constexpr double kMaxSpeedMs = 300.0;  // below the speed of sound in air
constexpr double kMaxSpinRadS = 1e4;
constexpr double kMaxEarDistanceM = 10.0;

using Quaternion = std::array<double, 4>;

double calc_norm(const Vec3& v) { return std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]); }

Quaternion multiply(const Quaternion& a, const Quaternion& b) {
  return {a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3], a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
          a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1], a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]};
}

/// Turns about the fixed axes of the world, x first, then y, then z.
Quaternion calc_rotation(const Vec3& degrees) {
  Quaternion rotation{1.0, 0.0, 0.0, 0.0};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double half = degrees[axis] * std::numbers::pi / 360.0;
    Quaternion turn{std::cos(half), 0.0, 0.0, 0.0};
    turn[axis + 1] = std::sin(half);
    rotation = multiply(turn, rotation);
  }
  return rotation;
}

/// A list of three numbers, each of at most `limit` in size.
Vec3 read_vector(config::Object& object, std::string_view key, const Vec3& fallback, double limit) {
  const Vec3 v = object.numbers_or<3>(key, fallback);
  for (const double x : v) {
    if (!(std::abs(x) <= limit)) object.fail(key, fmt::format("{} is out of range; give numbers between {} and {}", x, -limit, limit));
  }
  return v;
}

/// A number from low to high, both included.
double read_within(config::Object& object, std::string_view key, double fallback, double low, double high) {
  const double value = object.number_or(key, fallback);
  if (!(value >= low && value <= high)) {
    object.fail(key, fmt::format("{} is out of range; give a number from {} to {}", value, low, high));
  }
  return value;
}

Quaternion read_rotation(config::Object& body) {
  if (!body.has("quaternion")) return calc_rotation(read_vector(body, "rotation_deg", {0.0, 0.0, 0.0}, 1e6));
  if (body.has("rotation_deg")) body.fail("quaternion", "says the same thing as \"rotation_deg\"; keep one of them");
  Quaternion q = body.numbers<4>("quaternion");
  const double norm = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  if (!(std::abs(norm - 1.0) < 1e-3)) {
    body.fail("quaternion", fmt::format("[w, x, y, z] has length {:.6g}; give a quaternion of length 1", norm));
  }
  for (double& x : q) x /= norm;
  return q;
}

SceneBody parse_body(config::Object& object) {
  SceneBody body;
  body.name = object.string("name");
  body.bank = object.path("bank");
  contact::BodySpec& spec = body.spec;
  spec.name = body.name;
  spec.fixed = object.boolean_or("fixed", false);
  spec.initial.position_m = read_vector(object, "position_m", {0.0, 0.0, 0.0}, kFarthestM);
  spec.initial.rotation = read_rotation(object);
  spec.velocity_m_s = read_vector(object, "velocity_m_s", {0.0, 0.0, 0.0}, kMaxSpeedMs);
  spec.angular_velocity_rad_s = read_vector(object, "angular_velocity_rad_s", {0.0, 0.0, 0.0}, kMaxSpinRadS);
  if (spec.fixed) {
    for (const char* key : {"velocity_m_s", "angular_velocity_rad_s"}) {
      if (object.has(key)) object.fail(key, "a fixed body does not move; take this key away or set \"fixed\" to false");
    }
  }
  spec.restitution = read_within(object, "restitution", spec.restitution, 0.0, 1.0);
  spec.friction = read_within(object, "friction", spec.friction, 0.0, 10.0);
  object.finish();
  return body;
}

contact::GroundSpec parse_ground(config::Object& object) {
  contact::GroundSpec ground;
  ground.height_m = read_within(object, "height_m", ground.height_m, -kFarthestM, kFarthestM);
  ground.young_modulus_pa = object.number_or("young_modulus_pa", ground.young_modulus_pa, config::kPositive);
  ground.poisson_ratio = object.number_or("poisson_ratio", ground.poisson_ratio, {-1.0, 0.5});
  ground.restitution = read_within(object, "restitution", ground.restitution, 0.0, 1.0);
  ground.friction = read_within(object, "friction", ground.friction, 0.0, 10.0);
  object.finish();
  return ground;
}

Listener parse_listener(config::Object& object) {
  Listener listener;
  listener.position_m = read_vector(object, "position_m", listener.position_m, kFarthestM);
  listener.ear_distance_m = read_within(object, "ear_distance_m", listener.ear_distance_m, 0.0, kMaxEarDistanceM);
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
  const double norm = calc_norm(direction);
  if (!(norm > 1e-9)) object.fail(key, "gives the listener no direction to look in; name another place or direction");
  for (int k = 0; k < 3; ++k) listener.facing[k] = direction[k] / norm;
  object.finish();
  return listener;
}

Output parse_output(config::Object& object) {
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
  const std::string format = object.choice_or("format", kSampleFormatNames, "pcm24");
  output.format =
      static_cast<SampleFormat>(std::find(kSampleFormatNames.begin(), kSampleFormatNames.end(), format) - kSampleFormatNames.begin());
  object.finish();
  return output;
}

}  // namespace

Scene parse_scene(const config::Document& document) {
  Scene scene;
  scene.file = document.file();
  config::Object root = document.root();
  scene.duration_s = root.number("duration_s", config::kPositive);
  if (scene.duration_s < kShortestS || scene.duration_s > kLongestS) {
    root.fail("duration_s", fmt::format("{} is out of range; give {} to {} s", scene.duration_s, kShortestS, kLongestS));
  }
  scene.sample_rate_hz = static_cast<int>(root.integer_if("sample_rate_hz", 8000, 192000).value_or(scene.sample_rate_hz));
  if (scene.duration_s * scene.sample_rate_hz > kMostSamples) {
    root.fail("duration_s", fmt::format("{} s at {} Hz need too much memory; give {:.0f} s at most or a lower \"sample_rate_hz\"",
                                        scene.duration_s, scene.sample_rate_hz, kMostSamples / scene.sample_rate_hz));
  }
  scene.gravity_m_s2 = read_vector(root, "gravity_m_s2", scene.gravity_m_s2, 1e4);
  if (auto ground = root.object_if("ground")) scene.ground = parse_ground(*ground);

  std::vector<config::Object> bodies = root.objects("bodies");
  if (bodies.empty()) {
    for (const char* later : {"listener", "output"}) root.has(later);
    root.finish();  // a mistyped key is the likeliest reason
    root.fail("bodies", "is missing or empty; list at least one body with a \"name\" and a \"bank\"");
  }
  if (bodies.size() > kMostBodies) root.fail("bodies", fmt::format("lists {} bodies; a scene may hold {}", bodies.size(), kMostBodies));
  std::set<std::string> names;
  for (config::Object& object : bodies) {
    scene.bodies.push_back(parse_body(object));
    const std::string& name = scene.bodies.back().name;
    if (!names.insert(name).second)
      object.fail("name", fmt::format("there is a body called \"{}\" already; give this one another name", name));
  }
  if (auto listener = root.object_if("listener")) scene.listener = parse_listener(*listener);
  if (auto output = root.object_if("output")) scene.output = parse_output(*output);
  root.finish();
  return scene;
}

std::array<Vec3, 2> calc_ears(const Listener& listener) {
  // Left is up x facing. Who looks straight up or down keeps the left ear towards -x.
  Vec3 left{-listener.facing[1], listener.facing[0], 0.0};
  const double norm = calc_norm(left);
  left = norm > 1e-6 ? Vec3{left[0] / norm, left[1] / norm, 0.0} : Vec3{-1.0, 0.0, 0.0};
  std::array<Vec3, 2> ears{listener.position_m, listener.position_m};
  for (int k = 0; k < 3; ++k) {
    ears[0][k] += 0.5 * listener.ear_distance_m * left[k];
    ears[1][k] -= 0.5 * listener.ear_distance_m * left[k];
  }
  return ears;
}

}  // namespace carillon::host
