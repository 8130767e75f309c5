// Named mallets for programs and scenes.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace carillon::material {

/// Solid sphere, or felt with the force K y^p at compression y.
struct NamedMallet {
  std::string name;
  double mass_kg = 0.0;
  double radius_m = 0.0;         // solid head
  std::string material = {};     // solid head: name in the material table
  double stiffness_n_m_p = 0.0;  // felt: K
  double exponent = 0.0;         // felt: p
  double restitution = 1.0;      // against a rigid body
};

/// Default speed.
inline constexpr double kMalletSpeedMs = 1.0;

const std::vector<NamedMallet>& get_mallets();
/// Throws InputError that lists the names and begins with `place` (an option, "file:line").
const NamedMallet& require_mallet(std::string_view place, std::string_view name);

}  // namespace carillon::material
