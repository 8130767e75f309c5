// Source: walls: infinite thin plates (Cremer, Heckl and Petersson, Structure-Borne Sound, 3rd ed., chapter 5) of common building
// materials.
//   Joints, cord, felt and hand are estimates; sources of all numbers: docs/howto/materials.md.
#include "runtime/material/supports.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <iterator>

#include "runtime/base/ranges.hpp"
#include "runtime/material/solids.hpp"
#include "runtime/material/table.hpp"

namespace carillon::material {
namespace {

constexpr double kMaxLoss = 1.0;  // d = omega eta / 2: beyond, modes hardly oscillate
constexpr double kMaxThicknessM = 100.0;
constexpr double kWallRad2S2 = 4e7;  // lambda at 1 kHz, reference of wall losses
constexpr double kMaxMassKg = 1e9, kMaxDampingNsM = 1e12, kMaxStiffnessNM = 1e15;

struct Joint {
  const char* name;
  double loss;
};

const std::vector<Base> kBases{
    {.name = "rigid"},
    {BaseKind::kPlate, "brick wall", 11e9, 0.2, 1900.0, 0.1, 0.0, 0.0, 0.0, 0.01},
    {BaseKind::kPlate, "concrete wall", 30e9, 0.2, 2300.0, 0.1, 0.0, 0.0, 0.0, 0.006},
    {BaseKind::kPlate, "plasterboard wall", 2.5e9, 0.2, 700.0, 0.0125, 0.0, 0.0, 0.0, 0.014},
    {BaseKind::kHalfSpace, "concrete block", 30e9, 0.2, 2300.0, 0.0, 0.0, 0.0, 0.0, 0.006},
};
const std::vector<Joint> kJoints{{"screwed", 0.01}, {"glued", 0.05}};
const std::vector<Base> kHolders{
    {.kind = BaseKind::kLumped, .name = "cord", .damping_n_s_m = 0.2},
    {.kind = BaseKind::kLumped, .name = "felt", .stiffness_n_m = 2e4, .loss_factor = 0.3},
    {.kind = BaseKind::kLumped, .name = "hand", .mass_kg = 5e-4, .damping_n_s_m = 2.0, .stiffness_n_m = 2e3},
};

template <class List>
std::vector<std::string> list_names(const List& list) {
  std::vector<std::string> names;
  for (const auto& entry : list) names.emplace_back(entry.name);
  return names;
}

const Base& find_base(const std::vector<Base>& list, const std::string& name) {
  return *std::find_if(list.begin(), list.end(), [&](const Base& base) { return base.name == name; });
}

Base read_lumped(base::Object& object) {
  Base base{.kind = BaseKind::kLumped};
  base.mass_kg = base::read_within(object, "mass_kg", 0.0, 0.0, kMaxMassKg);
  base.damping_n_s_m = base::read_within(object, "damping_n_s_m", 0.0, 0.0, kMaxDampingNsM);
  base.stiffness_n_m = base::read_within(object, "stiffness_n_m", 0.0, 0.0, kMaxStiffnessNM);
  base.loss_factor = base::read_within(object, "loss_factor", 0.0, 0.0, kMaxLoss);
  object.finish();
  return base;
}

/// Wall of custom thickness or material.
Base read_wall(base::Object& object) {
  Base base{.kind = BaseKind::kPlate, .loss_factor = 0.01};
  if (object.has("material")) {
    const Material& material = MaterialTable::get().require(object.find_place("material"), object.string("material")).material;
    base.young_modulus_pa = material.young_modulus_pa;
    base.poisson_ratio = material.poisson_ratio;
    base.density_kg_m3 = material.density_kg_m3;
    base.loss_factor = 2.0 * material.calc_decay_per_s(kWallRad2S2) / std::sqrt(kWallRad2S2);
  }
  if (!object.has("material") || object.has("young_modulus_pa"))
    base.young_modulus_pa = base::read_within(object, "young_modulus_pa", kMinStiffnessPa, kMaxStiffnessPa);
  if (!object.has("material") || object.has("density_kg_m3"))
    base.density_kg_m3 = base::read_within(object, "density_kg_m3", kMinDensityKgM3, kMaxDensityKgM3);
  base.thickness_m = base::read_within(object, "thickness_m", 1e-6, kMaxThicknessM);
  base.poisson_ratio = object.number_or("poisson_ratio", base.poisson_ratio, {-1.0, 0.5});
  base.loss_factor = base::read_within(object, "loss_factor", base.loss_factor, 0.0, kMaxLoss);
  object.finish();
  return base;
}

Base read_base(base::Object& object) {
  if (object.has_object("on")) {
    base::Object base = object.object("on");
    if (base.has("material") || base.has("thickness_m") || base.has("young_modulus_pa") || base.has("density_kg_m3"))
      return read_wall(base);
    Base lumped = read_lumped(base);
    if (lumped.mass_kg == 0.0 && lumped.damping_n_s_m == 0.0 && lumped.stiffness_n_m == 0.0)
      object.fail(
          "on",
          "an impedance of 0 cannot hold a body; give \"mass_kg\", \"damping_n_s_m\" or \"stiffness_n_m\", or compute the body without "
          "fixed nodes");
    return lumped;
  }
  const std::string name = object.string("on");
  if (const auto& holders = list_holder_names(); std::find(holders.begin(), holders.end(), name) != holders.end())
    object.fail("on", fmt::format("\"{}\" is too soft to fix a body: compute the bank without fixed nodes, and give the scene's body "
                                  "\"held\": {{\"by\": \"{}\", \"point_m\": [x, y, z]}}",
                                  name, name));
  return find_base(kBases, object.choice("on", list_base_names()));
}

base::Json write_lumped(const Base& base) {
  return base::Json::object()
      .set("mass_kg", base.mass_kg)
      .set("damping_n_s_m", base.damping_n_s_m)
      .set("stiffness_n_m", base.stiffness_n_m)
      .set("loss_factor", base.loss_factor);
}

}  // namespace

const std::vector<std::string>& list_base_names() {
  static const std::vector<std::string> names = list_names(kBases);
  return names;
}

const std::vector<std::string>& list_joint_names() {
  static const std::vector<std::string> names = list_names(kJoints);
  return names;
}

const std::vector<std::string>& list_holder_names() {
  static const std::vector<std::string> names = list_names(kHolders);
  return names;
}

std::optional<Fixing> read_fixing(base::Object& object) {
  if (!object.has("on") && !object.has("joint") && !object.has("loss")) return std::nullopt;
  Fixing fixing;
  if (object.has("on")) fixing.base = read_base(object);
  if (object.has("joint")) {
    if (object.has("loss")) object.fail("loss", "conflicts with \"joint\"; keep one of them");
    fixing.joint = object.choice("joint", list_joint_names());
    fixing.joint_loss = std::find_if(kJoints.begin(), kJoints.end(), [&](const Joint& joint) { return fixing.joint == joint.name; })->loss;
  } else {
    fixing.joint_loss = base::read_within(object, "loss", 0.0, 0.0, kMaxLoss);
  }
  return fixing;
}

Base read_holder(base::Object& object, std::string_view key) {
  if (!object.has_object(key)) return find_base(kHolders, object.choice(key, list_holder_names()));
  base::Object numbers = object.object(key);
  return read_lumped(numbers);
}

base::Json write_fixing(const Fixing& fixing, base::Json json) {
  const Base& base = fixing.base;
  if (!base.name.empty() && base.kind != BaseKind::kRigid) {
    json.set("on", base.name);
  } else if (base.kind == BaseKind::kPlate) {
    json.set("on", base::Json::object()
                       .set("young_modulus_pa", base.young_modulus_pa)
                       .set("poisson_ratio", base.poisson_ratio)
                       .set("density_kg_m3", base.density_kg_m3)
                       .set("thickness_m", base.thickness_m)
                       .set("loss_factor", base.loss_factor));
  } else if (base.kind == BaseKind::kLumped) {
    json.set("on", write_lumped(base));
  }
  if (!fixing.joint.empty())
    json.set("joint", fixing.joint);
  else if (fixing.joint_loss > 0.0)
    json.set("loss", fixing.joint_loss);
  return json;
}

std::string describe(const Base& base) {
  if (!base.name.empty()) return base.name;
  switch (base.kind) {
    case BaseKind::kPlate:
      return fmt::format("a wall of {:g} mm", 1e3 * base.thickness_m);
    case BaseKind::kLumped:
      return fmt::format("{:g} kg, {:g} N s/m, {:g} N/m", base.mass_kg, base.damping_n_s_m, base.stiffness_n_m);
    default:
      return "rigid";
  }
}

std::string describe(const Fixing& fixing) {
  std::string text = fmt::format("on {}", describe(fixing.base));
  const auto out = std::back_inserter(text);
  if (!fixing.joint.empty())
    fmt::format_to(out, ", {}", fixing.joint);
  else if (fixing.joint_loss > 0.0)
    fmt::format_to(out, ", loss factor {:g} at the fixed nodes", fixing.joint_loss);
  return text;
}

}  // namespace carillon::material
