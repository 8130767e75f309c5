// Source: felts and yarn: power laws of piano hammers (Chaigne and Askenfelt 1994, J. Acoust. Soc. Am. 95, 1112: K 4e8 to 1e12, p 2.3 to
//   3), the softer ones estimates; masses, radii and restitutions are estimates.
#include "runtime/material/mallets.hpp"

#include <fmt/core.h>

#include "runtime/base/error.hpp"

namespace carillon::material {

const std::vector<NamedMallet>& get_mallets() {
  static const std::vector<NamedMallet> mallets{
      {.name = "steel", .mass_kg = 0.033, .radius_m = 0.010, .material = "steel", .restitution = 0.95},
      {.name = "hard-wood", .mass_kg = 0.020, .radius_m = 0.015, .material = "maple", .restitution = 0.8},
      {.name = "plastic", .mass_kg = 0.015, .radius_m = 0.0145, .material = "nylon", .restitution = 0.85},
      {.name = "rubber", .mass_kg = 0.020, .radius_m = 0.016, .material = "rubber", .restitution = 0.7},
      {.name = "hard-felt", .mass_kg = 0.010, .stiffness_n_m_p = 4.5e9, .exponent = 2.5, .restitution = 0.7},
      {.name = "soft-felt", .mass_kg = 0.020, .stiffness_n_m_p = 4e8, .exponent = 2.3, .restitution = 0.7},
      {.name = "yarn", .mass_kg = 0.030, .stiffness_n_m_p = 5e7, .exponent = 2.2, .restitution = 0.6},
  };
  return mallets;
}

const NamedMallet& require_mallet(std::string_view place, std::string_view name) {
  std::string names;
  for (const NamedMallet& mallet : get_mallets()) {
    if (mallet.name == name) return mallet;
    names += (names.empty() ? "" : ", ") + mallet.name;
  }
  throw InputError(fmt::format("{}: \"{}\" is no known mallet; give one of {}, or, in a scene, its numbers", place, name, names));
}

}  // namespace carillon::material
