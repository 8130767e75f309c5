#include <fmt/format.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <string>
#include <vector>

#include "runtime/material/mallets.hpp"
#include "runtime/material/table.hpp"
#include "runtime/scene/scene_bodies.hpp"

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

using base::Limits;
using base::required;

constexpr double kMaxImpulseNs = 1e6;     // a ton at 1000 m/s
constexpr double kFeltRestitution = 0.7;  // own estimate; piano hammers lose about half of their energy
constexpr double kDensestKgM3 = 22600.0;  // osmium

const base::Keys<SceneStrike> kStrike{
    {"time_s", &SceneStrike::time_s, "middle of the pulse; the start is within the scene, too", required},
    {"body", "required", "name of a body"},
    {"point_m", &SceneStrike::point_m, base::within(kFarthestM),
     "or `triangle`: point near the surface, in the axes of the mesh, at most a quarter of the body's extent off"},
    {"triangle", &SceneStrike::triangle, Limits{0, std::numeric_limits<std::int32_t>::max()}, "or centre of this triangle of the bank"},
    {"impulse_n_s", "one of them", "integral of the force, in the axes of the mesh"},
    {"mallet", "one of them", "name or object: [mallet](#mallets), which gives impulse and duration"},
    {"duration_s", &SceneStrike::duration_s, Limits{0, 1},
     "length of the pulse (`sin^1.5`); 0 is an ideal impulse, with a warning above 1 N s or 20 J in the modes"}};
const base::Keys<Mallet> kMallet{
    {"from", "none", "name of a mallet, whose numbers the other keys replace"},
    {"mass_kg", &Mallet::mass_kg, Limits{1e-6, 1e3}, "required without `from`: of the head; a loosely held stick adds little"},
    {"speed_m_s", &Mallet::speed_m_s, Limits{1e-6, kMaxSpeedMS}, "required without `from`: relative to the body"},
    {"felt", "none", "soft head: `{\"stiffness_n_m_p\": K, \"exponent\": p}` of F = K y^p, p 2.5 by default, of felts 2.2 to 3.5"},
    {"restitution", &Mallet::restitution, Limits{0, 1},
     "on a rigid surface: loss in the head (Hunt and Crossley); 0.7 with `felt`, own estimate"},
    {"friction", &Mallet::friction, Limits{0, 10}, "Coulomb; matters for oblique blows"},
    {"direction", "into the surface", "of the head's motion, in the axes of the mesh"}};
const base::Keys<Mallet> kHardHead{
    {"material", "none", "hard head: [material](materials.md) of its elasticity"},
    {"young_modulus_pa", &Mallet::young_modulus_pa, Limits{kSoftestPa, kStiffestPa}, "hard head: or Young's modulus"},
    {"radius_m", &Mallet::radius_m, Limits{1e-4, 10}, "hard head: of the sphere at the contact (Hertz's law)", required},
    {"poisson_ratio", &Mallet::poisson_ratio, Limits{-1, 0.5, true}, "hard head: Poisson's ratio"}};
const base::Keys<Felt> kFelt{{"stiffness_n_m_p", &Felt::stiffness_n_m_p, Limits{1e-3, 1e30}, "K", required},
                             {"exponent", &Felt::exponent, Limits{1, 6}, "p"}};

/// A named mallet.
Mallet read_named_mallet(base::Object& object, std::string_view key) {
  return make_mallet(material::require_mallet(object.find_place(key), object.string(key)));
}

/// A felt or an elastic sphere.
void read_head(base::Object& object, Mallet& mallet) {
  if (auto felt = object.object_if("felt")) {
    for (const char* key : {"radius_m", "material", "young_modulus_pa", "poisson_ratio"}) {
      if (object.has(key)) object.fail(key, "is for hard heads, and there is a \"felt\"; keep one of them");
    }
    kFelt.read(*felt, mallet.felt.emplace());
    mallet.restitution = kFeltRestitution;
    felt->finish();
    return;
  }
  mallet.felt.reset();
  if (read_material(object, mallet.young_modulus_pa, mallet.poisson_ratio) == nullptr && !object.has("young_modulus_pa"))
    object.fail("young_modulus_pa",
                "is missing; give the hardness of the head: \"material\" or \"young_modulus_pa\", and \"radius_m\", or \"felt\"");
  kHardHead.read(object, mallet);
}

Mallet read_mallet(base::Object& object, std::vector<std::string>& warnings) {
  Mallet mallet;
  const bool is_derived = object.has("from");
  if (is_derived) mallet = read_named_mallet(object, "from");
  for (const char* key : {"mass_kg", "speed_m_s"})
    if (!is_derived) (void)object.number(key);
  const bool has_head = object.has("felt") || object.has("material") || object.has("young_modulus_pa") || object.has("radius_m");
  if (!is_derived || has_head) read_head(object, mallet);
  kMallet.read(object, mallet);
  const double sphere_kg_m3 = mallet.felt ? 0.0 : mallet.mass_kg / (4.0 / 3.0 * std::numbers::pi * std::pow(mallet.radius_m, 3));
  if (sphere_kg_m3 > kDensestKgM3) {
    warnings.push_back(
        fmt::format("{}: a sphere of {:g} m and {:g} kg would be denser than osmium; \"radius_m\" is the radius at the contact, in metres",
                    object.find_place("radius_m"), mallet.radius_m, mallet.mass_kg));
  }
  if (object.has("direction")) mallet.direction = read_direction(object, "direction");
  object.finish();
  return mallet;
}

SceneStrike read_strike(base::Object& object, Scene& scene, const Names& names) {
  SceneStrike strike;
  strike.place = object.find_place("");
  strike.body = find_body(object, names);
  kStrike.read(object, strike);
  if (!(strike.time_s - 0.5 * strike.duration_s >= 0.0 && strike.time_s <= scene.duration_s)) {
    object.fail("time_s", fmt::format("{} s is out of range; the middle of a pulse and its beginning must be within the {} s of the scene",
                                      strike.time_s, scene.duration_s));
  }
  if (object.has("point_m") == object.has("triangle")) {
    object.fail(object.has("point_m") ? "triangle" : "point_m", "give the place: either \"point_m\" or \"triangle\"");
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
    root.fail("strikes", fmt::format("has {} strikes, at most {} are allowed", strikes.size(), kMaxStrikes));
  }
  for (base::Object& object : strikes) scene.strikes.push_back(read_strike(object, scene, names));
}

void describe_strike_keys(std::vector<base::KeyTable>& tables) {
  kStrike.describe(tables.emplace_back(base::KeyTable{"strike", {}}));
  base::KeyTable& mallet = tables.emplace_back(base::KeyTable{"mallet", {}});
  kMallet.describe(mallet);
  kHardHead.describe(mallet);
}

}  // namespace carillon::scene
