// Is it a solid? Stiffness and density that no solid has, and the unit that they were likely given in.
#pragma once

#include <optional>
#include <string>

namespace carillon::material {

/// Hard limits: every reader refuses values outside them.
inline constexpr double kMinStiffnessPa = 1e-6, kMaxStiffnessPa = 1e16;
inline constexpr double kMinDensityKgM3 = 1e-6, kMaxDensityKgM3 = 1e8;

/// One line about implausible Young's modulus and density of one material, which names the unit that was probably meant, or, where none
/// fits, says that no known solid has these values:
/// "young_modulus_pa is 72: was it given in GPa? 72 GPa are 7.2e+10 Pa; ...". Nothing where both, and the speed of sound that they give,
/// are those of a solid, foams and aerogels included; gels and soft rubbers are asked about and accepted.
/// `stiffness_key` and `density_key` name the numbers in the text;
/// `stiffness_pa` is the number of that key where it is another constant than `young_modulus_pa` (of Lame's, say).
std::optional<std::string> ask_about_solid(double young_modulus_pa, double density_kg_m3,
                                           const std::string& stiffness_key = "young_modulus_pa",
                                           const std::string& density_key = "density_kg_m3",
                                           std::optional<double> stiffness_pa = std::nullopt);

}  // namespace carillon::material
