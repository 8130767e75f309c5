// Plausibility of stiffness and density; detection of wrong units.
#pragma once

#include <optional>
#include <string>

namespace carillon::material {

/// Hard limits of all readers.
inline constexpr double kMinStiffnessPa = 1e-6, kMaxStiffnessPa = 1e16;
inline constexpr double kMinDensityKgM3 = 1e-6, kMaxDensityKgM3 = 1e8;

/// Warning for implausible Young's modulus and density, with the probable unit:
/// "young_modulus_pa is 72: was it given in GPa? 72 GPa are 7.2e+10 Pa; ...". nullopt for plausible solids, foams and aerogels included;
/// gels and soft rubbers cause a warning. `stiffness_key` and `density_key` name the numbers in the text; `stiffness_pa`: the value of
/// stiffness_key if it is another constant than Young's modulus (Lame's).
std::optional<std::string> ask_about_solid(double young_modulus_pa, double density_kg_m3,
                                           const std::string& stiffness_key = "young_modulus_pa",
                                           const std::string& density_key = "density_kg_m3",
                                           std::optional<double> stiffness_pa = std::nullopt);

}  // namespace carillon::material
