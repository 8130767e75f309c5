#include "runtime/scene/scene_bodies.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "runtime/base/quaternion.hpp"
#include "runtime/material/supports.hpp"
#include "runtime/material/table.hpp"
#include "runtime/scene/job_keys.hpp"

namespace carillon::scene {
namespace {

using base::Limits;
using base::within;

constexpr std::size_t kMaxHolders = 1000;

const base::Keys<SceneBody> kBody{
    {"name", "required", "unique, at most 200 bytes"},
    {"bank", "one of these", "mode bank; bodies may share one"},
    {"shape", "one of these", "or `body`, or `mesh`: [description of the body](#bodies-without-a-bank)"},
    {"recording", "one of these", "a recorded surface, with [other keys](#recordings)"},
    {"position_m", "`[0, 0, 0]`", "of the mesh's origin"},
    {"rotation_deg", "`[0, 0, 0]`", "about the fixed axes x, then y, then z"},
    {"quaternion", "none", "replaces `rotation_deg`: unit `[w, x, y, z]`"},
    {"on", "the bank's", "with `joint`, `loss`: what is behind its fixed nodes, like `\"brick wall\"` ([supports](materials.md#supports))"},
    {"supports", "none", "the same per support by name: `{\"left\": {\"on\": \"concrete wall\"}}`"},
    {"held", "none", "contact with a holder, or a list: `{\"by\": \"cord\", \"point_m\": [x, y, z]}` in the axes of the mesh"},
    {"variation", "the scene's", "variation of equal strikes; 0 to 1"},
    {"gain", &SceneBody::gain, Limits{0, 1e6}, "factor of its pressure"},
    {"effects", "the scene's", "[effects](#effects) of this body"},
    {"nonlinear", "its effects", "[large motion](nonlinear-bodies.md): `\"auto\"`, true (needs a bank with a nonlinear energy) or false"}};
const base::Keys<physics::BodySpec> kMotion{
    {"fixed", &physics::BodySpec::fixed, "does not move, but is struck and sounds"},
    {"absent", &physics::BodySpec::absent, "not in the world until it is [added live](hear-a-scene.md#commands)"},
    {"velocity_m_s", &physics::BodySpec::velocity_m_s, within(kMaxSpeedMS), "initial velocity of the centre of mass"},
    {"angular_velocity_rad_s", &physics::BodySpec::angular_velocity_rad_s, within(physics::kMaxSpinRadS), "initial angular velocity"},
    {"restitution", &physics::BodySpec::restitution, Limits{0, 1},
     "upper limit of the rebound: ringing bodies may keep more. Contacts use the geometric mean of both bodies"},
    {"friction", &physics::BodySpec::friction, Limits{0, 10}, "Coulomb coefficient. Contacts use the geometric mean of both bodies"},
    {"rolling_resistance", &physics::BodySpec::rolling_resistance, Limits{0, 1},
     "couple that resists rolling, over radius times load; larger on soft or rough surfaces. Contacts use the larger one of both bodies"},
    {"roughness_m", &physics::BodySpec::roughness_m, Limits{0, kRoughestM}, "rms height of the surface ([Roughness](#roughness))"}};
const base::Keys<SceneSurface> kSurface{
    {"recording", "required", "the file; bodies may share one"},
    {"position_m", "`[0, 0, 0]`", "of the simulation's world in the scene"},
    {"rotation_deg", "`[0, 0, 0]`", "or `quaternion`, of the simulation's world in the scene"},
    {"start_s", &SceneSurface::start_s, Limits{0, kLongestS}, "start, to the nearest sample"},
    {"loop", &SceneSurface::loop, "repeats without a crossfade; for recordings of 0.1 s and more"},
    {"gain", &SceneSurface::gain, Limits{0, 1e6}, "factor of the pressure"},
    {"high_pass_hz", &SceneSurface::high_pass_hz, Limits{0, 1000}, "high-pass as in a simulation; 0: none"}};

/// Rotations about the fixed axes of the world: x first, then y, then z.
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

/// A list of distinct effects.
synth::EffectSet read_names(base::Object& object, std::string_view key) {
  std::vector<std::string> playable;
  for (const synth::Effect effect : synth::EffectSet::all()) playable.emplace_back(synth::get_name(effect));
  synth::EffectSet effects;
  for (const base::Entry& entry : object.entries(key, std::numeric_limits<std::size_t>::max())) {
    const auto refuse = [&](const std::string& what) { throw InputError(fmt::format("{}: \"{}\" {}", entry.place, key, what)); };
    if (entry.object) refuse("must be a list of names of effects, and holds an object");
    const std::optional<synth::Effect> effect = synth::find_effect(entry.text);
    if (!effect) {
      const std::string nearest = base::find_nearest(entry.text, playable);
      refuse(fmt::format("names \"{}\", which is not an available effect{}; there are {}", entry.text,
                         nearest.empty() ? "" : fmt::format(" (did you mean \"{}\"?)", nearest), fmt::join(playable, ", ")));
    }
    if (effects.has(*effect)) refuse(fmt::format("names \"{}\" twice", entry.text));
    effects = effects.with(*effect);
  }
  return effects;
}

/// "auto"; a list: exactly these; or {"base": "auto", "on": [...], "off": [...], "doppler": true, ...}.
effects::EffectOverrides read_effects(base::Object& object) {
  effects::EffectOverrides overrides;
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
  for (const synth::Effect effect : synth::EffectSet::all()) {
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

/// A body's "nonlinear", which overrides its effects: "auto", true or false.
void read_nonlinear(base::Object& body, effects::EffectOverrides& overrides) {
  constexpr synth::Effect kEffect = synth::Effect::kNonlinear;
  if (!body.has("nonlinear")) return;
  if (body.has("effects") && (overrides.on.has(kEffect) || overrides.off.has(kEffect)))
    body.fail("nonlinear", "repeats \"effects\" of this body; keep one of them");
  const bool is_automatic = body.has_string("nonlinear");
  if (is_automatic) {
    body.choice_or("nonlinear", {"auto"}, "auto");
    if (!overrides.automatic)
      body.fail("nonlinear", "is \"auto\", but the list in \"effects\" leaves nothing to choose; give true or false");
  }
  const bool is_on = !is_automatic && body.boolean_or("nonlinear", false);
  overrides.on = is_on ? overrides.on.with(kEffect) : overrides.on.without(kEffect);
  overrides.off = is_automatic || is_on || !overrides.automatic ? overrides.off.without(kEffect) : overrides.off.with(kEffect);
}

/// Effects of bodies without planning.
synth::EffectSet find_usual(const effects::EffectOverrides& overrides) {
  return overrides.automatic ? kDefaultEffects.with(overrides.on).without(overrides.off) : overrides.on;
}

/// Fixings and holders of a body.
mounting::MountingRequest read_support(base::Object& body) {
  mounting::MountingRequest overrides;
  overrides.all = material::read_fixing(body);
  if (auto supports = body.object_if("supports")) {
    for (const std::string& name : supports->keys()) {
      base::Object one = supports->object(name);
      const auto fixing = material::read_fixing(one);
      one.finish();
      if (!fixing) supports->fail(name, "is empty; give \"on\", \"joint\" or \"loss\"");
      overrides.by_name.emplace(name, *fixing);
    }
  }
  for (base::Entry& entry : body.entries("held", kMaxHolders)) {
    if (!entry.object)
      throw InputError(
          fmt::format("{}: \"held\": give the point as well: {{\"by\": \"{}\", \"point_m\": [x, y, z]}}", entry.place, entry.text));
    mounting::Holder holder{.by = material::read_holder(*entry.object, "by")};
    holder.point_m = read_required_vector(*entry.object, "point_m");
    entry.object->finish();
    overrides.held.push_back(holder);
  }
  return overrides;
}

/// The bank of a body, or the keys of a job that computes it.
void read_bank_or_job(base::Object& object, SceneBody& body) {
  static const std::vector<std::string> kBodies{"shape", "body", "mesh"};
  static const std::vector<std::string> kKeys(kJobKeys.begin(), kJobKeys.end());
  const bool is_described = std::any_of(kBodies.begin(), kBodies.end(), [&](const std::string& key) { return object.has(key); });
  if (!is_described || object.has("bank")) {
    for (const std::string& key : kKeys)
      if (object.has("bank") && object.has(key))
        object.fail(key, "describes a body to be computed, and \"bank\" is a computed one; keep one of them");
    body.bank = object.path("bank");
    return;
  }
  body.job = object.make_excerpt(kKeys);
}

SceneBody parse_body(base::Object& object, const Scene& scene) {
  SceneBody body;
  body.name = base::read_name(object, "name");
  body.place = object.find_place("");
  read_bank_or_job(object, body);
  body.variation = read_within(object, "variation", scene.variation, 0.0, 1.0);
  physics::BodySpec& spec = body.spec;
  spec.name = body.name;
  kMotion.read(object, spec);
  kBody.read(object, body);
  spec.initial.position_m = read_vector(object, "position_m", {0.0, 0.0, 0.0}, kFarthestM);
  spec.initial.rotation = read_rotation(object);
  if (spec.fixed) {
    for (const char* key : {"velocity_m_s", "angular_velocity_rad_s"}) {
      if (object.has(key)) object.fail(key, "a fixed body does not move; remove this key or set \"fixed\" to false");
    }
  }
  body.support = read_support(object);
  for (const char* key : {"on", "joint", "loss", "supports", "held"}) {
    if (body.support_place.empty() && object.has(key)) body.support_place = object.find_place(key);
  }
  body.overrides = object.has("effects") ? read_effects(object) : scene.overrides;
  read_nonlinear(object, body.overrides);
  object.finish();
  return body;
}

void check_count(base::Object& object, const char* key, std::size_t bodies) {
  if (bodies > kMaxBodies) object.fail(key, fmt::format("has {} bodies, at most {} are allowed: split the scene", bodies, kMaxBodies));
}

[[noreturn]] void refuse_name(base::Object& object, const std::string& name) {
  object.fail("name", fmt::format("there is a body called \"{}\" already; give this one another name", name));
}

SceneSurface parse_surface(base::Object& object) {
  SceneSurface surface;
  surface.name = base::read_name(object, "name");
  surface.place = object.find_place("recording");
  surface.file = object.path("recording");
  for (const char* key : {"bank", "shape", "body", "mesh"})
    if (object.has(key)) object.fail(key, "describes a vibrating body, and \"recording\" a recorded one; keep one of them");
  surface.pose.position_m = read_vector(object, "position_m", {0.0, 0.0, 0.0}, kFarthestM);
  surface.pose.rotation = read_rotation(object);
  kSurface.read(object, surface);
  object.finish();
  return surface;
}

}  // namespace

Vec3 read_required_vector(base::Object& object, std::string_view key, double limit) {
  return base::read_vector_within(object, key, -limit, limit);
}

Vec3 read_direction(base::Object& object, std::string_view key) {
  Vec3 v = read_required_vector(object, key);
  const double length = norm(v);
  if (!(length > 1e-9)) object.fail(key, "is no direction; give three numbers, not all 0");
  for (double& x : v) x /= length;
  return v;
}

const material::Material* read_material(base::Object& object, double& young_modulus_pa, double& poisson_ratio) {
  if (!object.has("material")) return nullptr;
  const material::Material& material =
      material::MaterialTable::get().require(object.find_place("material"), object.string("material")).material;
  young_modulus_pa = material.young_modulus_pa;
  poisson_ratio = material.poisson_ratio;
  return &material;
}

Names parse_bodies(base::Object& root, Scene& scene) {
  std::vector<base::Object> bodies = root.objects("bodies");
  check_count(root, "bodies", bodies.size());
  if (root.has("effects")) scene.overrides = read_effects(root);
  scene.effects = find_usual(scene.overrides);
  Names names;
  for (base::Object& object : bodies) {
    const bool is_recorded = object.has("recording");
    if (is_recorded)
      scene.surfaces.push_back(parse_surface(object));
    else
      scene.bodies.push_back(parse_body(object, scene));
    const std::string& name = is_recorded ? scene.surfaces.back().name : scene.bodies.back().name;
    if (!names.emplace(name, is_recorded ? kNotModal : scene.bodies.size() - 1).second) refuse_name(object, name);
  }
  return names;
}

SceneBody parse_new_body(const base::Document& document, const Scene& scene) {
  base::Object root = document.root();
  check_count(root, "", scene.bodies.size() + 1);
  if (root.has("recording")) root.fail("recording", "plays from the start of a scene only; name a \"bank\"");
  SceneBody body = parse_body(root, scene);
  const auto is_called = [&](const auto& other) { return other.name == body.name; };
  if (std::any_of(scene.bodies.begin(), scene.bodies.end(), is_called) ||
      std::any_of(scene.surfaces.begin(), scene.surfaces.end(), is_called))
    refuse_name(root, body.name);
  return body;
}

void describe_body_keys(std::vector<base::KeyTable>& tables) {
  base::KeyTable& body = tables.emplace_back(base::KeyTable{"body", {}});
  kBody.describe(body);
  kMotion.describe(body);
  kSurface.describe(tables.emplace_back(base::KeyTable{"recording", {}}));
}

std::size_t find_body(base::Object& object, const Names& bodies, std::string_view key) {
  const std::string name = object.string(key);
  if (const auto found = bodies.find(name); found != bodies.end()) {
    if (found->second != kNotModal) return found->second;
    object.fail(key, fmt::format("\"{}\" is a recording, which cannot be struck, joined or held; name a body with a bank", name));
  }
  std::vector<std::string> names;
  for (const auto& [known, index] : bodies) names.push_back(known);
  const std::string nearest = base::find_nearest(name, names);
  object.fail(key, fmt::format("no body is called \"{}\"; {}", name,
                               nearest.empty() ? "give the name of one of \"bodies\"" : fmt::format("did you mean \"{}\"?", nearest)));
}

}  // namespace carillon::scene
