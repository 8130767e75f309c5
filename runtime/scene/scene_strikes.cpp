#include "runtime/scene/scene_strikes.hpp"

#include <fmt/format.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <string>
#include <vector>

#include "runtime/scene/scene_values.hpp"
#include "runtime/material/mallets.hpp"
#include "runtime/material/table.hpp"

namespace carillon::scene {

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

constexpr double kMaxImpulseNs = 1e6;  // a ton at 1000 m/s
constexpr double kLongestPulseS = 1.0;
constexpr double kFeltRestitution = 0.7;  // our estimate; piano hammers lose about half of their energy
constexpr double kDensestKgM3 = 22600.0;  // osmium

/// The mallet of the name at `key`.
Mallet read_named_mallet(base::Object& object, std::string_view key) {
  return make_mallet(material::require_mallet(object.find_place(key), object.string(key)));
}

/// A head by numbers: a felt, or a sphere of a solid.
void read_head(base::Object& object, Mallet& mallet) {
  if (auto felt = object.object_if("felt")) {
    for (const char* key : {"radius_m", "material", "young_modulus_pa", "poisson_ratio"}) {
      if (object.has(key)) object.fail(key, "is of a hard head, and there is a \"felt\"; keep one of them");
    }
    mallet.felt = Felt{.stiffness_n_m_p = read_within(*felt, "stiffness_n_m_p", 1e-3, 1e30)};
    mallet.felt->exponent = read_within(*felt, "exponent", mallet.felt->exponent, 1.0, 6.0);
    mallet.restitution = kFeltRestitution;
    felt->finish();
    return;
  }
  mallet.felt.reset();
  if (read_material(object, mallet.young_modulus_pa, mallet.poisson_ratio) == nullptr && !object.has("young_modulus_pa"))
    object.fail("young_modulus_pa",
                "is missing; say how hard the head is: \"material\" or \"young_modulus_pa\", and \"radius_m\", or \"felt\"");
  if (object.has("young_modulus_pa")) mallet.young_modulus_pa = read_within(object, "young_modulus_pa", kSoftestPa, kStiffestPa);
  mallet.radius_m = read_within(object, "radius_m", 1e-4, 10.0);
  mallet.poisson_ratio = object.number_or("poisson_ratio", mallet.poisson_ratio, {-1.0, 0.5});
}

Mallet read_mallet(base::Object& object, std::vector<std::string>& warnings) {
  Mallet mallet;
  const bool is_derived = object.has("from");
  if (is_derived) mallet = read_named_mallet(object, "from");
  if (!is_derived || object.has("mass_kg")) mallet.mass_kg = read_within(object, "mass_kg", 1e-6, 1e3);
  if (!is_derived || object.has("speed_m_s")) mallet.speed_m_s = read_within(object, "speed_m_s", 1e-6, kMaxSpeedMs);
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
  if (object.has("direction")) mallet.direction = read_direction(object, "direction");
  object.finish();
  return mallet;
}

SceneStrike read_strike(base::Object& object, Scene& scene, const Names& names) {
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
      strike.mallet = read_mallet(mallet, scene.warnings);
    }
  } else {
    strike.impulse_n_s = read_required_vector(object, "impulse_n_s", kMaxImpulseNs);
  }
  object.finish();
  return strike;
}

}  // namespace

void parse_strikes(base::Object& root, const Names& names, Scene& scene) {
  std::vector<base::Object> strikes = root.objects("strikes");
  if (strikes.size() > kMaxStrikes) {
    root.fail("strikes", fmt::format("lists {} strikes; a scene may hold {}", strikes.size(), kMaxStrikes));
  }
  for (base::Object& object : strikes) scene.strikes.push_back(read_strike(object, scene, names));
}

}  // namespace carillon::scene
