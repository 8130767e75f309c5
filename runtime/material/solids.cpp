// Method: plausible ranges of stiffness, density and speed of sound sqrt(E / rho). Outside them the common units are tried: the first unit,
//   or pair, that gives an ordinary solid is suggested.
// Source: Ashby, Materials Selection in Mechanical Design (2011), chapter 4, modulus-density charts: E from 1e5 Pa (soft foams) to 1.2e12
//   Pa (diamond), density from 10 (foams) to 22 600 kg/m^3 (osmium), sqrt(E / rho) from 30 m/s to 20 km/s. Gels and soft rubbers (1e3 to
//   1e6 Pa) lie below, where a unit error is as likely: they cause a warning only.
#include "runtime/material/solids.hpp"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <string_view>

namespace carillon::material {
namespace {

constexpr double kSoftestPa = 4e3, kStiffestPa = 1.3e12;
constexpr double kLightestKgM3 = 5.0, kHeaviestKgM3 = 23000.0;
constexpr double kMinSpeedMs = 30.0, kMaxSpeedMs = 20000.0;
constexpr double kMinSoftSpeedMs = 1.0;  // gels and soft rubbers
// No foam, rubber or gel is that dense, no metal or stone that slow.
constexpr double kHeavyKgM3 = 2000.0, kMinHeavySpeedMs = 200.0;

struct Unit {
  std::string_view name;
  double factor;  // to SI units
};
constexpr std::array kStiffnessUnits{Unit{"", 1.0}, Unit{"GPa", 1e9}, Unit{"MPa (N/mm^2)", 1e6}, Unit{"psi", 6894.757},
                                     Unit{"ksi", 6.894757e6}};
constexpr std::array kDensityUnits{Unit{"", 1.0}, Unit{"g/cm^3", 1e3}, Unit{"lb/ft^3", 16.018463}, Unit{"t/mm^3", 1e12},
                                   Unit{"lb/in^3", 27679.9}};

bool is_solid(double e, double rho) {
  const double speed = std::sqrt(e / rho);
  return e >= kSoftestPa && e <= kStiffestPa && rho >= kLightestKgM3 && rho <= kHeaviestKgM3 &&
         speed >= (rho > kHeavyKgM3 ? kMinHeavySpeedMs : kMinSpeedMs) && speed <= kMaxSpeedMs;
}

/// Ordinary engineering solid.
bool is_ordinary(double e, double rho) {
  const double speed = std::sqrt(e / rho);
  return e >= 1e8 && e <= kStiffestPa && rho >= 100.0 && rho <= kHeaviestKgM3 && speed >= 300.0 && speed <= 13000.0;
}

bool is_soft(double e, double rho) { return e >= 1e2 && rho >= 500.0 && rho <= kHeavyKgM3 && std::sqrt(e / rho) >= kMinSoftSpeedMs; }

std::string ask(const std::string& key, double value, const Unit& unit, std::string_view si) {
  return fmt::format("{} is {:g}: was it given in {}? {:g} {} are {:.3g} {}", key, value, unit.name, value, unit.name, value * unit.factor,
                     si);
}

}  // namespace

std::optional<std::string> ask_about_solid(double young_modulus_pa, double density_kg_m3, const std::string& stiffness_key,
                                           const std::string& density_key, std::optional<double> stiffness_pa) {
  if (is_solid(young_modulus_pa, density_kg_m3)) return std::nullopt;
  const double stiffness = stiffness_pa.value_or(young_modulus_pa);
  for (const bool both : {false, true}) {
    for (const Unit& of_e : kStiffnessUnits) {
      for (const Unit& of_rho : kDensityUnits) {
        const bool has_e = !of_e.name.empty(), has_rho = !of_rho.name.empty();
        if (both ? !(has_e && has_rho) : has_e == has_rho) continue;
        if (!is_ordinary(young_modulus_pa * of_e.factor, density_kg_m3 * of_rho.factor)) continue;
        std::string text = has_e ? ask(stiffness_key, stiffness, of_e, "Pa") : "";
        if (has_rho) text += (has_e ? "; " : "") + ask(density_key, density_kg_m3, of_rho, "kg/m^3");
        if (is_soft(young_modulus_pa, density_kg_m3)) text += "; ignore this for a gel or a soft rubber";
        return text;
      }
    }
  }
  return fmt::format(
      "{} of {:g} and {} of {:g} give a speed of sound of {:.3g} m/s; together these belong to no known solid (stiffness {:g} to "
      "{:g} Pa, density {:g} to {:g} kg/m^3): check the units",
      stiffness_key, stiffness, density_key, density_kg_m3, std::sqrt(young_modulus_pa / density_kg_m3), kSoftestPa, kStiffestPa,
      kLightestKgM3, kHeaviestKgM3);
}

}  // namespace carillon::material
