// The reader of one format, a short function for each of its keys; longer than most files.
#include "runtime/host/scene.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <span>
#include <utility>

#include "runtime/base/quaternion.hpp"
#include "runtime/base/vector.hpp"
#include "runtime/head/sphere.hpp"
#include "runtime/host/job_keys.hpp"
#include "runtime/material/mallets.hpp"
#include "runtime/material/solids.hpp"
#include "runtime/material/supports.hpp"
#include "runtime/material/table.hpp"

namespace carillon::host {
namespace {

constexpr double kShortestS = 1e-3;
constexpr double kLongestS = 3600.0;
constexpr double kFarthestM = 1e4;  // of positions; sound takes half a minute from there
constexpr std::size_t kMaxBodies = 1000;
constexpr std::size_t kLongestName = 200;  // bytes
constexpr double kMaxSpeedMs = 300.0;      // below the speed of sound in air
constexpr double kMaxSpinRadS = 1e4;
constexpr double kMaxEarDistanceM = 10.0;
constexpr double kHeadWidthM = 2.0 * head::Sphere{}.radius_m;
constexpr double kNarrowestHeadM = 2.0 * head::kMinRadiusM, kWidestHeadM = 2.0 * head::kMaxRadiusM;
constexpr std::size_t kMaxWaypoints = 100000;
constexpr std::size_t kMaxMicrophones = 16;
constexpr std::size_t kMaxHolders = 1000;
constexpr std::size_t kMaxStrikes = 100000;
constexpr double kMaxImpulseNs = 1e6;  // a ton at 1000 m/s
constexpr double kLongestPulseS = 1.0;
constexpr double kSoftestGroundPa = 100.0;  // a jelly; the touch of a body lasts as long as a person's step on less
constexpr double kStiffestGroundPa = 1e13;  // ten times a diamond
constexpr double kFeltRestitution = 0.7;    // our estimate; piano hammers lose about half of their energy
constexpr double kDensestKgM3 = 22600.0;    // osmium
constexpr double kLoudestGain = 1e6;        // 120 dB
constexpr double kRoughestM = 1e-3;         // what is higher is no roughness but a shape

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
Vec3 read_vector(base::Object& object, std::string_view key, const Vec3& fallback, double limit) {
  const Vec3 v = object.numbers_or<3>(key, fallback);
  for (const double x : v) {
    if (!(std::abs(x) <= limit)) object.fail(key, fmt::format("{} is out of range; give numbers between {} and {}", x, -limit, limit));
  }
  return v;
}

/// A number from low to high, both included.
double read_within(base::Object& object, std::string_view key, double fallback, double low, double high) {
  const double value = object.number_or(key, fallback);
  if (!(value >= low && value <= high)) {
    object.fail(key, fmt::format("{} is out of range; give a number from {} to {}", value, low, high));
  }
  return value;
}

Quaternion read_rotation(base::Object& body) {
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

/// The effects that "key" of `object` names, none twice.
synth::EffectSet read_names(base::Object& object, std::string_view key) {
  std::vector<std::string> playable;
  for (const synth::Effect effect : kPlayableEffects) playable.emplace_back(synth::get_name(effect));
  synth::EffectSet effects;
  for (const base::Entry& entry : object.entries(key, std::numeric_limits<std::size_t>::max())) {
    const auto refuse = [&](const std::string& what) { throw InputError(fmt::format("{}: \"{}\" {}", entry.place, key, what)); };
    if (entry.object) refuse("must be a list of names of effects, and holds an object");
    const std::optional<synth::Effect> effect = synth::find_effect(entry.text);
    if (effect && !kPlayableEffects.has(*effect)) {
      refuse(fmt::format("names \"{}\", which is not in this build (CMake option CARILLON_EFFECTS); there are {}", entry.text,
                         fmt::join(playable, ", ")));
    }
    if (!effect) {
      const std::string nearest = base::find_nearest(entry.text, playable);
      refuse(fmt::format("names \"{}\", which is no effect that can be played{}; there are {}", entry.text,
                         nearest.empty() ? "" : fmt::format(" (did you mean \"{}\"?)", nearest), fmt::join(playable, ", ")));
    }
    if (effects.has(*effect)) refuse(fmt::format("names \"{}\" twice", entry.text));
    effects = effects.with(*effect);
  }
  return effects;
}

/// "auto"; a list: exactly these; or {"base": "auto", "on": [...], "off": [...], "doppler": true, ...}.
effect_selection::EffectOverrides read_effects(base::Object& object) {
  effect_selection::EffectOverrides overrides;
  if (object.has_string("effects")) {
    const std::string text = object.string("effects");
    if (text != "auto") {
      object.fail("effects", fmt::format("is \"{}\"; give \"auto\", a list of names, or {{\"on\": [...], \"off\": [...]}}", text));
    }
    return overrides;
  }
  if (!object.has_object("effects")) {
    overrides.automatic = false;
    overrides.on = read_names(object, "effects");
    return overrides;
  }
  base::Object keys = object.object("effects");
  keys.choice_or("base", {"auto"}, "auto");
  if (keys.has("on")) overrides.on = read_names(keys, "on");
  if (keys.has("off")) overrides.off = read_names(keys, "off");
  for (const synth::Effect effect : kPlayableEffects) {
    const char* name = synth::get_name(effect);
    if (!keys.has(name)) continue;
    if (keys.has_string(name)) {
      keys.choice_or(name, {"auto"}, "auto");
      continue;
    }
    synth::EffectSet& set = keys.boolean_or(name, false) ? overrides.on : overrides.off;
    if (set.has(effect)) keys.fail(name, fmt::format("is in \"{}\" already; keep one of them", &set == &overrides.on ? "on" : "off"));
    set = set.with(effect);
  }
  for (const synth::Effect effect : overrides.on.common(overrides.off)) {
    keys.fail("off", fmt::format("names \"{}\", and so does \"on\"; keep one of them", synth::get_name(effect)));
  }
  keys.finish();
  return overrides;
}

/// A body's own "nonlinear", over what its effects say of that one: "auto", on or off.
void read_nonlinear(base::Object& body, effect_selection::EffectOverrides& overrides) {
  constexpr synth::Effect kEffect = synth::Effect::kNonlinear;
  if (!body.has("nonlinear")) return;
  if (body.has("effects") && (overrides.on.has(kEffect) || overrides.off.has(kEffect)))
    body.fail("nonlinear", "says what \"effects\" of this body say already; keep one of them");
  const bool is_automatic = body.has_string("nonlinear");
  if (is_automatic) {
    body.choice_or("nonlinear", {"auto"}, "auto");
    if (!overrides.automatic)
      body.fail("nonlinear", "is \"auto\", and its effects are a list, so that nothing is chosen; give true or false");
  }
  const bool is_on = !is_automatic && body.boolean_or("nonlinear", false);
  if (is_on && !kPlayableEffects.has(kEffect))
    body.fail("nonlinear", "asks for the effect \"nonlinear\", which is not in this build (CMake option CARILLON_EFFECTS)");
  overrides.on = is_on ? overrides.on.with(kEffect) : overrides.on.without(kEffect);
  overrides.off = is_automatic || is_on || !overrides.automatic ? overrides.off.without(kEffect) : overrides.off.with(kEffect);
}

/// Exactly the overrides, where effects are not selected.
synth::EffectSet find_usual(const effect_selection::EffectOverrides& overrides) {
  return overrides.automatic ? kDefaultEffects.with(overrides.on).without(overrides.off) : overrides.on;
}

/// What fixes or carries a body.
support::MountingRequest read_support(base::Object& body) {
  support::MountingRequest overrides;
  overrides.all = material::read_fixing(body);
  if (auto supports = body.object_if("supports")) {
    for (const std::string& name : supports->keys()) {
      base::Object one = supports->object(name);
      const auto fixing = material::read_fixing(one);
      one.finish();
      if (!fixing) supports->fail(name, "says nothing; give \"on\", \"joint\" or \"loss\"");
      overrides.by_name.emplace(name, *fixing);
    }
  }
  for (base::Entry& entry : body.entries("held", kMaxHolders)) {
    if (!entry.object)
      throw InputError(fmt::format("{}: \"held\": say where as well: {{\"by\": \"{}\", \"point_m\": [x, y, z]}}", entry.place, entry.text));
    support::Holder holder{.by = material::read_holder(*entry.object, "by")};
    if (!entry.object->has("point_m")) entry.object->numbers<3>("point_m");  // its message
    holder.point_m = read_vector(*entry.object, "point_m", {}, kFarthestM);
    entry.object->finish();
    overrides.held.push_back(holder);
  }
  return overrides;
}

/// The bank of a body, or what a job says of one, which the solver's side reads.
void read_bank_or_job(base::Object& object, SceneBody& body) {
  static const std::vector<std::string> kBodies{"shape", "body", "mesh"};
  static const std::vector<std::string> kKeys(kJobKeys.begin(), kJobKeys.end());
  const bool is_described = std::any_of(kBodies.begin(), kBodies.end(), [&](const std::string& key) { return object.has(key); });
  if (!is_described || object.has("bank")) {
    for (const std::string& key : kKeys)
      if (object.has("bank") && object.has(key))
        object.fail(key, "describes the body to be computed, and \"bank\" names it computed; keep one of them");
    body.bank = object.path("bank");
    return;
  }
  body.job = object.make_excerpt(kKeys);
}

std::string read_body_name(base::Object& object) {
  std::string name = object.string("name");
  if (name.size() > kLongestName || std::any_of(name.begin(), name.end(), [](unsigned char c) { return c < 0x20 || c == 0x7f; })) {
    object.fail("name",
                fmt::format("is no name: at most {} bytes, and none of them a line feed or another control character", kLongestName));
  }
  return name;
}

SceneBody parse_body(base::Object& object, const effect_selection::EffectOverrides& overrides, double variation) {
  SceneBody body;
  body.name = read_body_name(object);
  body.place = object.find_place("");
  read_bank_or_job(object, body);
  body.variation = read_within(object, "variation", variation, 0.0, 1.0);
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
  spec.roughness_m = read_within(object, "roughness_m", spec.roughness_m, 0.0, kRoughestM);
  body.support = read_support(object);
  for (const char* key : {"on", "joint", "loss", "supports", "held"}) {
    if (body.support_place.empty() && object.has(key)) body.support_place = object.find_place(key);
  }
  body.overrides = object.has("effects") ? read_effects(object) : overrides;
  read_nonlinear(object, body.overrides);
  object.finish();
  return body;
}

/// A body that is a recorded surface.
SceneSurface parse_surface(base::Object& object) {
  SceneSurface surface;
  surface.name = read_body_name(object);
  surface.place = object.find_place("recording");
  surface.file = object.path("recording");
  for (const char* key : {"bank", "shape", "body", "mesh"})
    if (object.has(key)) object.fail(key, "describes a body that is struck, and \"recording\" one that was recorded; keep one of them");
  surface.pose.position_m = read_vector(object, "position_m", {0.0, 0.0, 0.0}, kFarthestM);
  surface.pose.rotation = read_rotation(object);
  surface.start_s = read_within(object, "start_s", surface.start_s, 0.0, kLongestS);
  surface.loop = object.boolean_or("loop", surface.loop);
  surface.gain = read_within(object, "gain", surface.gain, 0.0, kLoudestGain);
  surface.high_pass_hz = read_within(object, "high_pass_hz", surface.high_pass_hz, 0.0, 1000.0);
  object.finish();
  return surface;
}

/// A required number from `low` to `high`.
double read_amount(base::Object& object, std::string_view key, double low, double high) {
  const double value = object.number(key);
  if (!(value >= low && value <= high))
    object.fail(key, fmt::format("{} is out of range; give a number from {:g} to {:g}", value, low, high));
  return value;
}

/// The material that "material" names; its own constants may follow.
template <class Solid>
const material::Material* take_material(base::Object& object, Solid& solid) {
  if (!object.has("material")) return nullptr;
  const material::Material& material =
      material::MaterialTable::get().require(object.find_place("material"), object.string("material")).material;
  solid.young_modulus_pa = material.young_modulus_pa;
  solid.poisson_ratio = material.poisson_ratio;
  return &material;
}

contact::GroundSpec parse_ground(base::Object& object, std::optional<double>& reflection, std::vector<std::string>& warnings) {
  contact::GroundSpec ground;
  if (const material::Material* material = take_material(object, ground)) ground.density_kg_m3 = material->density_kg_m3;
  ground.height_m = read_within(object, "height_m", ground.height_m, -kFarthestM, kFarthestM);
  ground.young_modulus_pa = object.number_or("young_modulus_pa", ground.young_modulus_pa, base::kPositive);
  ground.density_kg_m3 = read_within(object, "density_kg_m3", ground.density_kg_m3, 1.0, 3e4);
  const auto question = material::ask_about_solid(ground.young_modulus_pa, ground.density_kg_m3);
  if (!(ground.young_modulus_pa >= kSoftestGroundPa && ground.young_modulus_pa <= kStiffestGroundPa)) {
    object.fail("young_modulus_pa", fmt::format("{:g} Pa is no plausible ground stiffness; give {:g} to {:g}{}", ground.young_modulus_pa,
                                                kSoftestGroundPa, kStiffestGroundPa, question ? ": " + *question : ""));
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

constexpr std::size_t kNotModal = std::numeric_limits<std::size_t>::max();
using Names = std::map<std::string, std::size_t>;  // of bodies, and their places in the list; kNotModal: a recorded surface

/// The body that a key names.
std::size_t find_body(base::Object& object, const Names& bodies, std::string_view key = "body") {
  const std::string name = object.string(key);
  if (const auto found = bodies.find(name); found != bodies.end()) {
    if (found->second != kNotModal) return found->second;
    object.fail(key, fmt::format("\"{}\" is a recording, which nothing strikes, joins or holds; name a body that has a bank", name));
  }
  std::vector<std::string> names;
  for (const auto& [known, index] : bodies) names.push_back(known);
  const std::string nearest = base::find_nearest(name, names);
  object.fail(key, fmt::format("no body is called \"{}\"; {}", name,
                               nearest.empty() ? "give the name of one of \"bodies\"" : fmt::format("did you mean \"{}\"?", nearest)));
}

/// "world", or a body's name.
int find_end(base::Object& object, const Names& bodies, std::string_view key) {
  if (object.string(key) == "world") return -1;
  return static_cast<int>(find_body(object, bodies, key));
}

/// A direction, of length 1.
Vec3 read_direction(base::Object& object, std::string_view key) {
  if (!object.has(key)) object.numbers<3>(key);  // its message
  Vec3 v = read_vector(object, key, {}, kFarthestM);
  const double length = norm(v);
  if (!(length > 1e-9)) object.fail(key, "is no direction; give three numbers that are not all 0");
  for (double& x : v) x /= length;
  return v;
}

Vec3 read_required_place(base::Object& object, std::string_view key) {
  if (!object.has(key)) object.numbers<3>(key);  // its message
  return read_vector(object, key, {}, kFarthestM);
}

contact::JointSpec parse_joint(base::Object& object, const Names& names) {
  contact::JointSpec joint;
  joint.place = object.find_place("");
  const std::string kind = object.choice("kind", kJointNames);
  joint.kind = static_cast<joints::Kind>(std::find(kJointNames.begin(), kJointNames.end(), kind) - kJointNames.begin());
  joint.body = static_cast<int>(find_body(object, names));
  joint.to = find_end(object, names, "to");
  joint.at_m = read_required_place(object, "at_m");
  const bool has_axis = joint.kind == joints::Kind::kHinge || joint.kind == joints::Kind::kSlider || joint.kind == joints::Kind::kUniversal;
  if (has_axis) joint.axis = read_direction(object, "axis");
  if (!has_axis && object.has("axis")) object.fail("axis", fmt::format("a {} has none; take it away", kind));
  if (joint.kind == joints::Kind::kUniversal) {
    joint.second_axis = read_direction(object, "second_axis");
    const double cosine =
        joint.axis[0] * joint.second_axis[0] + joint.axis[1] * joint.second_axis[1] + joint.axis[2] * joint.second_axis[2];
    if (!(std::abs(cosine) < 1e-3)) object.fail("second_axis", "must be at right angles to \"axis\"");
    for (std::size_t k = 0; k < 3; ++k) joint.second_axis[k] -= cosine * joint.axis[k];
    const double length = norm(joint.second_axis);
    for (double& x : joint.second_axis) x /= length;
  } else if (object.has("second_axis")) {
    object.fail("second_axis", "belongs to a universal joint alone; take it away");
  }
  if (joint.kind == joints::Kind::kWeld) {
    if (object.has("damping")) object.fail("damping", "a weld does not move; take it away");
  } else {
    joint.damping = read_within(object, "damping", 0.0, 0.0, 1e6);
  }
  const bool turns = joint.kind == joints::Kind::kHinge, slides = joint.kind == joints::Kind::kSlider;
  for (const auto& [key, is_meant] : {std::pair{"limits_deg", turns}, {"limits_m", slides}}) {
    if (!object.has(key)) continue;
    if (!is_meant) object.fail(key, fmt::format("a {} has none; a hinge has \"limits_deg\", a slider \"limits_m\"", kind));
    std::array<double, 2> limits = object.numbers<2>(key);
    const double max = turns ? contact::kWidestHingeDeg : kFarthestM;
    if (!(limits[0] <= 0.0 && limits[1] >= 0.0 && limits[0] >= -max && limits[1] <= max && limits[1] - limits[0] > 1e-3))
      object.fail(key, fmt::format("must be [lowest, highest] with the start, 0, between them, within {:g}", max));
    for (double& limit : limits) limit *= turns ? std::numbers::pi / 180.0 : 1.0;
    joint.limits = limits;
  }
  if (joint.limits)
    joint.stop_restitution = read_within(object, "stop_restitution", 0.0, 0.0, 1.0);
  else if (object.has("stop_restitution"))
    object.fail("stop_restitution", "belongs to \"limits_deg\" or \"limits_m\"; give them, too");
  object.finish();
  return joint;
}

contact::CordSpec parse_cord(base::Object& object, const Names& names) {
  contact::CordSpec cord;
  cord.place = object.find_place("");
  base::Object from = object.object("from"), to = object.object("to");
  cord.body = static_cast<int>(find_body(from, names));
  cord.from_m = read_required_place(from, "at_m");
  from.finish();
  cord.to = to.has("body") ? find_end(to, names, "body") : -1;
  cord.to_m = read_required_place(to, "at_m");
  to.finish();
  if (object.has("length_m")) {
    cord.length_m = object.number("length_m", base::kPositive);
    const Vec3 apart{cord.from_m[0] - cord.to_m[0], cord.from_m[1] - cord.to_m[1], cord.from_m[2] - cord.to_m[2]};
    if (!(*cord.length_m >= norm(apart) - 1e-9 && *cord.length_m <= kFarthestM))
      object.fail(
          "length_m",
          fmt::format("{:g} m is less than the {:.6g} m between its ends at the start (or more than {:g} m); give at least that, or "
                      "leave it out",
                      *cord.length_m, norm(apart), kFarthestM));
  }
  cord.restitution = read_within(object, "restitution", 0.0, 0.0, 1.0);
  object.finish();
  return cord;
}

}  // namespace

Mallet make_mallet(const material::NamedMallet& named) {
  Mallet mallet{.mass_kg = named.mass_kg, .speed_m_s = material::kMalletSpeedMs, .restitution = named.restitution};
  if (named.material.empty()) {
    mallet.felt = Felt{named.stiffness_n_m_p, named.exponent};
  } else {
    const material::Material& head = material::MaterialTable::get().require(named.name, named.material).material;
    mallet.radius_m = named.radius_m;
    mallet.young_modulus_pa = head.young_modulus_pa;
    mallet.poisson_ratio = head.poisson_ratio;
  }
  return mallet;
}

namespace {

/// The mallet that the text of `key` names.
Mallet read_named_mallet(base::Object& object, std::string_view key) {
  return make_mallet(material::require_mallet(object.find_place(key), object.string(key)));
}

/// The head of one that is given by numbers: a felt, or a sphere of a solid.
void read_head(base::Object& object, Mallet& mallet) {
  if (auto felt = object.object_if("felt")) {
    for (const char* key : {"radius_m", "material", "young_modulus_pa", "poisson_ratio"}) {
      if (object.has(key)) object.fail(key, "is of a hard head, and there is a \"felt\"; keep one of them");
    }
    mallet.felt = Felt{.stiffness_n_m_p = read_amount(*felt, "stiffness_n_m_p", 1e-3, 1e30)};
    mallet.felt->exponent = read_within(*felt, "exponent", mallet.felt->exponent, 1.0, 6.0);
    mallet.restitution = kFeltRestitution;
    felt->finish();
    return;
  }
  mallet.felt.reset();
  if (take_material(object, mallet) == nullptr && !object.has("young_modulus_pa"))
    object.fail("young_modulus_pa",
                "is missing; say how hard the head is: \"material\" or \"young_modulus_pa\", and \"radius_m\", or \"felt\"");
  if (object.has("young_modulus_pa"))
    mallet.young_modulus_pa = read_amount(object, "young_modulus_pa", kSoftestGroundPa, kStiffestGroundPa);
  mallet.radius_m = read_amount(object, "radius_m", 1e-4, 10.0);
  mallet.poisson_ratio = object.number_or("poisson_ratio", mallet.poisson_ratio, {-1.0, 0.5});
}

Mallet parse_mallet(base::Object& object, std::vector<std::string>& warnings) {
  Mallet mallet;
  const bool is_derived = object.has("from");
  if (is_derived) mallet = read_named_mallet(object, "from");
  if (!is_derived || object.has("mass_kg")) mallet.mass_kg = read_amount(object, "mass_kg", 1e-6, 1e3);
  if (!is_derived || object.has("speed_m_s")) mallet.speed_m_s = read_amount(object, "speed_m_s", 1e-6, kMaxSpeedMs);
  const bool has_head = object.has("felt") || object.has("material") || object.has("young_modulus_pa") || object.has("radius_m");
  if (!is_derived || has_head) read_head(object, mallet);
  const double sphere_kg_m3 = mallet.felt ? 0.0 : mallet.mass_kg / (4.0 / 3.0 * std::numbers::pi * std::pow(mallet.radius_m, 3));
  if (sphere_kg_m3 > kDensestKgM3) {
    warnings.push_back(
        fmt::format("{}: a sphere of {:g} m that weighs {:g} kg would be denser than osmium; \"radius_m\" is that of the "
                    "head where it touches, in metres",
                    object.find_place("radius_m"), mallet.radius_m, mallet.mass_kg));
  }
  mallet.restitution = read_within(object, "restitution", mallet.restitution, 0.0, 1.0);
  mallet.friction = read_within(object, "friction", mallet.friction, 0.0, 10.0);
  if (object.has("direction")) {
    Vec3 direction = read_vector(object, "direction", {}, kFarthestM);
    const double length = norm(direction);
    if (!(length > 1e-9)) object.fail("direction", "is no direction; give the way of the head as three numbers");
    for (double& x : direction) x /= length;
    mallet.direction = direction;
  }
  object.finish();
  return mallet;
}

SceneStrike parse_strike(base::Object& object, Scene& scene, const Names& names) {
  SceneStrike strike;
  strike.place = object.find_place("");
  strike.body = find_body(object, names);
  strike.time_s = object.number("time_s");
  strike.duration_s = read_within(object, "duration_s", strike.duration_s, 0.0, kLongestPulseS);
  if (!(strike.time_s - 0.5 * strike.duration_s >= 0.0 && strike.time_s <= scene.duration_s)) {
    object.fail("time_s",
                fmt::format("{} s is out of range; the middle of a pulse lies within the {} s of the scene, and its beginning too",
                            strike.time_s, scene.duration_s));
  }
  if (object.has("point_m") == object.has("triangle")) {
    object.fail(object.has("point_m") ? "triangle" : "point_m", "say where the body is struck: either \"point_m\" or \"triangle\"");
  }
  if (object.has("point_m")) {
    strike.point_m = read_vector(object, "point_m", {}, kFarthestM);
  } else {
    strike.triangle = static_cast<std::int32_t>(object.integer("triangle", 0, std::numeric_limits<std::int32_t>::max()));
  }
  if (object.has("mallet")) {
    for (const char* key : {"impulse_n_s", "duration_s"}) {
      if (object.has(key)) object.fail(key, "follows from the \"mallet\"; keep one of them");
    }
    if (object.has_string("mallet")) {
      strike.mallet = read_named_mallet(object, "mallet");
    } else {
      base::Object mallet = object.object("mallet");
      strike.mallet = parse_mallet(mallet, scene.warnings);
    }
  } else {
    if (!object.has("impulse_n_s")) object.numbers<3>("impulse_n_s");  // its message
    strike.impulse_n_s = read_vector(object, "impulse_n_s", {}, kMaxImpulseNs);
  }
  object.finish();
  return strike;
}

/// A place in the world out of a row of numbers.
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

/// The position of the text of `key` among names.
std::size_t read_name(base::Object& object, std::string_view key, const std::vector<std::string>& names, const std::string& fallback) {
  const std::string name = object.choice_or(key, names, fallback);
  return static_cast<std::size_t>(std::find(names.begin(), names.end(), name) - names.begin());
}

/// What the ears of a listener are: free, on a sphere or on a measured head.
void parse_ears(base::Object& object, SceneListener& listener, std::vector<std::string>& warnings) {
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
  if (kPlayableEffects.has(synth::Effect::kHead)) return;
  listener.ears = Ears::kFree;
  warnings.push_back(object.find_place("ears") + ": this build has no heads (the effect \"head\"); the ears are heard as free ones");
}

SceneListener parse_listener(base::Object& object, std::vector<std::string>& warnings) {
  SceneListener listener;
  if (object.has("path")) {
    if (object.has("position_m")) object.fail("path", "says the same thing as \"position_m\"; keep one of them");
    listener.path = read_path(object, "path");
    listener.position_m = listener.path.front().position_m;
  } else {
    listener.position_m = read_vector(object, "position_m", listener.position_m, kFarthestM);
  }
  parse_ears(object, listener, warnings);
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
  effect_selection::SelectionThresholds& thresholds = quality.thresholds;
  if (object.has("planner_db")) thresholds.audible_share = std::pow(10.0, 0.1 * read_within(object, "planner_db", 0.0, -150.0, -10.0));
  thresholds.below_loudest_db = read_within(object, "quiet_db", thresholds.below_loudest_db, 20.0, 250.0);
  thresholds.lead_s = read_within(object, "lead_s", thresholds.lead_s, 0.001, 1.0);
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

/// A body that is to be heard by a head needs one; where effects are not planned, all are.
void check_head(base::Object& root, Scene& scene) {
  const bool is_wanted = std::any_of(scene.bodies.begin(), scene.bodies.end(),
                                     [](const SceneBody& body) { return body.overrides.on.has(synth::Effect::kHead); });
  if (is_wanted && !has_head(scene))
    root.fail("effects", "names \"head\", and the listener has none; give it \"ears\": \"hrtf\", or leave \"head\" out");
  if (has_head(scene) && scene.overrides.automatic && !scene.overrides.off.has(synth::Effect::kHead))
    scene.effects = scene.effects.with(synth::Effect::kHead);
}

/// The ground reflects where it says how much, or where a body is to be heard reflected; then all who hear must be above it.
void check_floor(base::Object& root, Scene& scene) {
  const auto wants = [](const effect_selection::EffectOverrides& overrides) { return overrides.on.has(synth::Effect::kGroundReflection); };
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

  std::vector<base::Object> bodies = root.objects("bodies");
  if (bodies.empty()) {
    for (const char* later :
         {"joints", "cords", "strikes", "listener", "microphones", "effects", "variation", "radiation", "frequencies", "output", "quality"})
      root.has(later);
    root.finish();  // a mistyped key is the likeliest reason
    root.fail("bodies", "is missing or empty; list at least one body with a \"name\" and a \"bank\", or a \"recording\"");
  }
  if (bodies.size() > kMaxBodies)
    root.fail("bodies",
              fmt::format("lists {} bodies; a scene may hold {}: leave some out, or make several scenes of it", bodies.size(), kMaxBodies));
  if (root.has("effects")) scene.overrides = read_effects(root);
  scene.effects = find_usual(scene.overrides);
  const double variation = read_within(root, "variation", 0.0, 0.0, 1.0);
  Names names;
  for (base::Object& object : bodies) {
    const bool is_recorded = object.has("recording");
    if (is_recorded)
      scene.surfaces.push_back(parse_surface(object));
    else
      scene.bodies.push_back(parse_body(object, scene.overrides, variation));
    const std::string& name = is_recorded ? scene.surfaces.back().name : scene.bodies.back().name;
    if (!names.emplace(name, is_recorded ? kNotModal : scene.bodies.size() - 1).second)
      object.fail("name", fmt::format("there is a body called \"{}\" already; give this one another name", name));
  }
  for (base::Object& object : root.objects("joints")) scene.joints.push_back(parse_joint(object, names));
  for (base::Object& object : root.objects("cords")) scene.cords.push_back(parse_cord(object, names));
  std::vector<base::Object> strikes = root.objects("strikes");
  if (strikes.size() > kMaxStrikes) {
    root.fail("strikes", fmt::format("lists {} strikes; a scene may hold {}", strikes.size(), kMaxStrikes));
  }
  for (base::Object& object : strikes) scene.strikes.push_back(parse_strike(object, scene, names));
  if (auto listener = root.object_if("listener")) scene.listener = parse_listener(*listener, scene.warnings);
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
  // Left is up x facing. Who looks straight up or down keeps the left ear towards -x.
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

}  // namespace carillon::host
