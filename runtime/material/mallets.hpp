// Mallets by name: heads of common mass and size, for programs and scenes.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace carillon::material {

/// A solid sphere, or a felt whose force is K y^p at a compression y.
struct NamedMallet {
  std::string name;
  double mass_kg = 0.0;
  double radius_m = 0.0;         // of a solid head
  std::string material = {};     // of a solid head: a name of the table
  double stiffness_n_m_p = 0.0;  // K of a felt
  double exponent = 0.0;         // p of a felt
  double restitution = 1.0;      // on something rigid
};

/// Its speed where none is given.
inline constexpr double kMalletSpeedMs = 1.0;

const std::vector<NamedMallet>& get_mallets();
/// Throws InputError that lists the names and begins with `place`: an option, "file:line".
const NamedMallet& require_mallet(std::string_view place, std::string_view name);

}  // namespace carillon::material
