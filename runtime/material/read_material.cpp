#include "runtime/material/read_material.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "runtime/base/vector.hpp"
#include "runtime/material/solids.hpp"
#include "runtime/material/table.hpp"

namespace carillon::material {
namespace {

constexpr double kMaxDampingS = 1e6, kMaxDampingPerS = 1e12;
constexpr double kMaxLossFactor = 2;  // d = omega eta / 2: critical damping at any frequency
constexpr double kMaxPower = 8;

[[noreturn]] void fail_unit(const base::Object& object, std::string_view key, double value) {
  const bool is_density = key == "density_kg_m3";
  object.fail(key, fmt::format("must be from {:g} to {:g}, a range that covers every solid, and is {:g}; check the unit{}",
                               is_density ? kMinDensityKgM3 : kMinStiffnessPa, is_density ? kMaxDensityKgM3 : kMaxStiffnessPa, value,
                               is_density && value < kMinDensityKgM3 ? " (steel is 7850 kg/m^3, or 7.85e-9 t/mm^3)" : ""));
}

double read_positive(base::Object& object, std::string_view key, double max) {
  const double value = object.number(key, base::kPositive);
  if (value < std::max(kMinStiffnessPa, kMinDensityKgM3) || value > max) fail_unit(object, key, value);
  return value;
}

/// The stiffness matrix loses log10(lambda / mu) digits (K / mu near nu = -1); a solve tolerates seven.
constexpr double kPoissonMargin = 1e-7;

void check_definite(base::Object& material, std::string_view key, double poisson_ratio) {
  if (poisson_ratio > 0.5 - kPoissonMargin || poisson_ratio < -1.0 + kPoissonMargin)
    material.fail(key,
                  fmt::format("gives a Poisson's ratio of {:.12g}, too near the limits -1 and 0.5 to be solved in double precision; keep "
                              "{:g} away from them",
                              poisson_ratio, kPoissonMargin));
}

/// E and nu, or lambda and mu: exactly one pair. E = mu (3 lambda + 2 mu) / (lambda + mu), nu = lambda / (2 (lambda + mu)).
void read_isotropic(base::Object& material, Material& result) {
  const bool engineering = material.has("young_modulus_pa") || material.has("poisson_ratio");
  const bool lame = material.has("lame_lambda_pa") || material.has("lame_mu_pa");
  if (engineering && lame) {
    material.fail(material.has("lame_lambda_pa") ? "lame_lambda_pa" : "lame_mu_pa",
                  "give young_modulus_pa and poisson_ratio, or lame_lambda_pa and lame_mu_pa, not both pairs");
  }
  if (!lame) {
    result.young_modulus_pa = read_positive(material, "young_modulus_pa", kMaxStiffnessPa);
    result.poisson_ratio = material.number("poisson_ratio", {-1.0, 0.5});
    check_definite(material, "poisson_ratio", result.poisson_ratio);
    return;
  }
  const double mu = read_positive(material, "lame_mu_pa", kMaxStiffnessPa);
  const double lambda = material.number("lame_lambda_pa", {-kMaxStiffnessPa, kMaxStiffnessPa});
  // Positive definite: mu > 0 and 3 lambda + 2 mu > 0.
  if (!(3 * lambda + 2 * mu > 0))
    material.fail("lame_lambda_pa", fmt::format("must be greater than -2/3 of lame_mu_pa ({}), and is {}", -2 * mu / 3, lambda));
  result.young_modulus_pa = mu * (3 * lambda + 2 * mu) / (lambda + mu);
  result.poisson_ratio = lambda / (2 * (lambda + mu));
  check_definite(material, "lame_lambda_pa", result.poisson_ratio);
}

/// Two or three directions, orthonormalised: the first is kept, the second made perpendicular, the third is their cross product.
void read_axes(base::Object& orthotropic, Orthotropic& result) {
  const auto rows = orthotropic.number_rows("axes", 3, 3);
  if (rows.size() < 2) orthotropic.fail("axes", "give two directions (or three), in the axes of the mesh: [[x, y, z], [x, y, z]]");
  std::array<std::array<double, 3>, 3> axis{};
  for (std::size_t r = 0; r < rows.size(); ++r) {
    std::copy(rows[r].begin(), rows[r].end(), axis[r].begin());
    const double max = std::max({std::abs(axis[r][0]), std::abs(axis[r][1]), std::abs(axis[r][2])});
    if (!(max > 0)) orthotropic.fail("axes", fmt::format("direction {} has no length", r + 1));
    for (double& value : axis[r]) value /= max;
    const double length = std::sqrt(dot(axis[r], axis[r]));
    // Keep unit vectors of a resolved job unchanged: resolving is idempotent.
    const bool is_unit = max == 1.0 ? std::abs(length - 1) < 1e-15 : std::abs(length * max - 1) < 4e-16;
    for (std::size_t k = 0; k < 3; ++k) axis[r][k] = is_unit ? rows[r][k] : axis[r][k] / length;
  }
  constexpr double kMaxSkew = 0.02;  // about one degree
  const auto check = [&](std::size_t a, std::size_t b) {
    const double cosine = dot(axis[a], axis[b]);
    if (std::abs(cosine) > kMaxSkew)
      orthotropic.fail("axes", fmt::format("directions {} and {} have to be perpendicular, and meet at {:.1f} degrees", a + 1, b + 1,
                                           std::acos(std::clamp(cosine, -1.0, 1.0)) * 180 / std::numbers::pi));
    return cosine;
  };
  const double skew = check(0, 1);
  if (rows.size() == 3) {
    check(0, 2);
    check(1, 2);
  }
  if (std::abs(skew) > 4e-16) {
    for (std::size_t k = 0; k < 3; ++k) axis[1][k] -= skew * axis[0][k];
    const double length = std::sqrt(dot(axis[1], axis[1]));
    for (double& value : axis[1]) value /= length;
  }
  for (std::size_t k = 0; k < 3; ++k)
    axis[2][k] = axis[0][(k + 1) % 3] * axis[1][(k + 2) % 3] - axis[0][(k + 2) % 3] * axis[1][(k + 1) % 3];
  result.axes = axis;
}

/// The compliance scaled to a unit diagonal has off-diagonals -nu_ij sqrt(E_j / E_i); its smallest eigenvalue must be positive.
void check_orthotropic(base::Object& object, const Orthotropic& o) {
  const auto& e = o.young_modulus_pa;
  const auto& nu = o.poisson_ratio;
  const double n12 = nu[0] * std::sqrt(e[1] / e[0]), n23 = nu[1] * std::sqrt(e[2] / e[1]), n13 = nu[2] * std::sqrt(e[2] / e[0]);
  const char* const names[3] = {"nu12", "nu23", "nu13"};
  const double scaled[3] = {n12, n23, n13};
  for (int i = 0; i < 3; ++i)
    if (!(std::abs(scaled[i]) < 1))
      object.fail("poisson_ratio",
                  fmt::format("{} is {:g} and has to lie within +-{:.6g}, which is the root of the ratio of its two Young's "
                              "moduli: beyond, the solid would gain energy from being strained; check the order nu12, nu23, nu13",
                              names[i], nu[i], std::abs(nu[i] / scaled[i])));
  // The eigenvalues of [0 a b; a 0 c; b c 0] are the roots of x^3 - p x - q, by Viete's formula.
  const double p = n12 * n12 + n23 * n23 + n13 * n13, q = -2 * n12 * n23 * n13;
  double min = 1.0;
  if (p > 0) {
    const double angle = std::acos(std::clamp(1.5 * q / p * std::sqrt(3 / p), -1.0, 1.0)) / 3;
    min = 1 + 2 * std::sqrt(p / 3) * std::cos(angle + 2 * std::numbers::pi / 3);
  }
  if (!(min > 2 * kPoissonMargin))  // 1 - 2 nu of an isotropic solid
    object.fail(
        "poisson_ratio",
        fmt::format("the elasticity is not positive definite: the least eigenvalue of the compliance (scaled to a unit diagonal) is "
                    "{:.3g}, and has to be above {:g}; multiply the three ratios by less than {:.4g}, or check their order nu12, "
                    "nu23, nu13 with nu_ij / E_i = nu_ji / E_j",
                    min, 2 * kPoissonMargin, 1 / (1 - min)));
}

void read_orthotropic(base::Object object, Material& result) {
  Orthotropic o;
  for (const auto& [key, values] :
       {std::pair{"young_modulus_pa", &o.young_modulus_pa}, std::pair{"shear_modulus_pa", &o.shear_modulus_pa}}) {
    *values = object.numbers<3>(key);
    for (const double value : *values)
      if (!(value >= kMinStiffnessPa && value <= kMaxStiffnessPa)) fail_unit(object, key, value);
  }
  o.poisson_ratio = object.numbers<3>("poisson_ratio");
  if (object.has("axes")) read_axes(object, o);
  object.finish();
  check_orthotropic(object, o);
  result.orthotropic = o;
  const double definite = calc_definiteness(result.calc_elasticity_pa());
  if (!(definite > 1e-9))
    object.fail("", fmt::format("the softest strain is {:.3g} times as stiff as the stiffest, too little to be solved in double precision; "
                                "keep them within 1e-9: check the units of the moduli",
                                definite));
  const double one = 1.0;
  const Equivalent equivalent = calc_equivalent({&result, 1}, {&one, 1});
  result.young_modulus_pa = equivalent.young_modulus_pa;
  result.poisson_ratio = equivalent.poisson_ratio;
}

void read_elasticity(base::Object& material, Material& result) {
  auto orthotropic = material.object_if("orthotropic");
  if (!orthotropic) return read_isotropic(material, result);
  for (const char* key : {"young_modulus_pa", "poisson_ratio", "lame_lambda_pa", "lame_mu_pa"})
    if (material.has(key)) material.fail(key, "\"orthotropic\" holds the elasticity; give one of the two");
  read_orthotropic(*orthotropic, result);
}

double read_not_negative(base::Object& object, std::string_view key, double max) {
  const double value = object.number_or(key, 0.0);
  if (value > max) object.fail(key, fmt::format("must be at most {:g}, and is {:g}; check the unit", max, value));
  if (value < 0) object.fail(key, fmt::format("must not be negative, and is {}", value));
  return value;
}

/// Requires 0 <= loss < 2. what: "tan(phi)", "the loss factor at 100 Hz".
void check_loss(base::Object& object, std::string_view key, const std::string& what, double loss) {
  if (loss >= 0 && loss < kMaxLossFactor) return;
  object.fail(key,
              fmt::format("{} must not be negative and must be below {:g}, where a mode's decay rate is its frequency and nothing swings "
                          "any more, and is {:g}; steel has 1e-4, wood 0.01, soft rubber up to 1",
                          what, kMaxLossFactor, loss));
}

void read_caughey(base::Object caughey, Material& result) {
  constexpr std::size_t kMaxTerms = 32;
  const std::vector<double> coefficients = caughey.number_list("coefficients", kMaxTerms);
  std::vector<double> powers;
  if (caughey.has("powers"))
    powers = caughey.number_list("powers", kMaxTerms);
  else
    for (std::size_t j = 0; j < coefficients.size(); ++j) powers.push_back(static_cast<double>(j));
  if (powers.size() != coefficients.size())
    caughey.fail("powers", fmt::format("must have one entry a coefficient, {}, and has {}", coefficients.size(), powers.size()));
  for (std::size_t j = 0; j < powers.size(); ++j) {
    if (std::abs(powers[j]) > kMaxPower) caughey.fail("powers", fmt::format("must lie within +-{:g}, and hold {:g}", kMaxPower, powers[j]));
    result.caughey.push_back({powers[j], coefficients[j]});
  }
  caughey.finish();
}

void read_loss_table(base::Object& damping, Material& result) {
  for (const auto& row : damping.number_rows("loss_table", 2, 100000)) {
    if (!(row[0] > 0))
      damping.fail("loss_table", fmt::format("a row is [frequency in Hz, loss factor], and a frequency is {:g}; give one above 0", row[0]));
    if (!result.loss_table.empty() && !(row[0] > result.loss_table.back().freq_hz))
      damping.fail("loss_table", fmt::format("frequencies must ascend: {:g} Hz follows {:g} Hz", row[0], result.loss_table.back().freq_hz));
    check_loss(damping, "loss_table", fmt::format("the loss factor at {:g} Hz", row[0]), row[1]);
    result.loss_table.push_back({row[0], row[1]});
  }
}

/// c is a sum of powers and may change sign anywhere: checked on a fine grid in log lambda.
void check_not_negative(base::Object& damping, const Material& material, const std::array<double, 2>& band_hz) {
  constexpr int kSteps = 4000;
  double worst = 0.0, worst_hz = 0.0;
  for (int i = 0; i <= kSteps; ++i) {
    const double f = i == 0        ? band_hz[0]
                     : i == kSteps ? band_hz[1]
                                   : band_hz[0] * std::pow(band_hz[1] / band_hz[0], static_cast<double>(i) / kSteps);
    const double lambda = std::pow(2 * std::numbers::pi * f, 2), c = material.calc_damping_per_s(lambda);
    double size = 0.0;
    for (const CaugheyTerm& term : material.caughey) size += std::abs(term.coefficient) * std::pow(lambda, term.power);
    if (!std::isfinite(size)) damping.fail("caughey", fmt::format("the series overflows at {:g} Hz; check the powers and the units", f));
    if (c < -1e-12 * size && c < worst) {
      worst = c;
      worst_hz = f;
    }
  }
  if (worst < 0)
    damping.fail("caughey",
                 fmt::format("the series is negative on the band, where the sound would swell: c = {:.3g} 1/s at {:.4g} Hz; change "
                             "the coefficients or the band",
                             worst, worst_hz));
}

void read_damping(base::Object damping, Material& result, const std::array<double, 2>& band_hz) {
  result.caughey.clear();
  result.loss_table.clear();
  std::string found;
  for (const char* law : {"rayleigh", "internal_friction", "caughey", "loss_table"}) {
    if (!damping.has(law)) continue;
    if (!found.empty()) damping.fail(law, fmt::format("a material has one damping law, and \"{}\" is given already; remove one", found));
    found = law;
  }
  if (found == "internal_friction") {
    base::Object friction = damping.object("internal_friction");
    result.law = DampingLaw::internal_friction;
    result.tan_phi = friction.number("tan_phi");
    check_loss(friction, "tan_phi", "tan(phi)", result.tan_phi);
    friction.finish();
  } else if (found == "caughey") {
    result.law = DampingLaw::caughey;
    read_caughey(damping.object("caughey"), result);
    check_not_negative(damping, result, band_hz);
  } else if (found == "loss_table") {
    result.law = DampingLaw::loss_table;
    read_loss_table(damping, result);
  } else {
    base::Object rayleigh = damping.object("rayleigh");
    result.law = DampingLaw::rayleigh;
    result.alpha1_s = read_not_negative(rayleigh, "alpha1_s", kMaxDampingS);
    result.alpha2_per_s = read_not_negative(rayleigh, "alpha2_per_s", kMaxDampingPerS);
    rayleigh.finish();
  }
  damping.finish();
}

/// Stiffness given by the job, with its key.
std::pair<std::string, double> find_stiffness(base::Object& material, const Material& result) {
  if (result.orthotropic) {
    const auto& e = result.orthotropic->young_modulus_pa;
    return {"orthotropic.young_modulus_pa", *std::max_element(e.begin(), e.end())};
  }
  if (material.has("lame_mu_pa")) return {"lame_mu_pa", result.lame_mu_pa()};
  return {"young_modulus_pa", result.young_modulus_pa};
}

void ask_about_units(base::Object& material, const Material& result, std::vector<std::string>& warnings) {
  const auto [key, stiffness] = find_stiffness(material, result);
  const double young = result.orthotropic ? stiffness : result.young_modulus_pa;
  if (const auto question = ask_about_solid(young, result.density_kg_m3, key, "density_kg_m3", stiffness))
    warnings.push_back(fmt::format("{}: {}", material.find_place(key.substr(0, key.find('.'))), *question));
}

/// Warns of zero damping, and of overdamping on most of the band, on a grid.
void ask_about_damping(base::Object& material, const Material& result, const std::array<double, 2>& band_hz,
                       std::vector<std::string>& warnings) {
  constexpr int kSteps = 60;
  int swinging = 0;
  double max = 0.0;
  for (int i = 0; i <= kSteps; ++i) {
    const double omega = 2 * std::numbers::pi * band_hz[0] * std::pow(band_hz[1] / band_hz[0], static_cast<double>(i) / kSteps);
    const double decay = result.calc_decay_per_s(omega * omega);
    max = std::max(max, decay);
    if (decay < omega) ++swinging;
  }
  const std::string place = material.find_place("damping");
  if (max == 0.0) {
    warnings.push_back(fmt::format(
        "{}: \"damping\" is zero: what is struck rings for ever; steel has \"internal_friction\" {{\"tan_phi\": 1e-4}}", place));
  } else if (2 * swinging < kSteps + 1) {
    warnings.push_back(fmt::format("{}: \"damping\" is so strong that {} of the band of {:g} to {:g} Hz rings: check the units{}", place,
                                   swinging == 0 ? "nothing" : "less than half", band_hz[0], band_hz[1],
                                   result.law == DampingLaw::rayleigh && result.alpha1_s > 1e-3
                                       ? fmt::format(" (alpha1_s is {:g} s; 1e-8 to 1e-6 s is usual)", result.alpha1_s)
                                       : ""));
  }
}

bool has_elasticity(base::Object& material) {
  return material.has("orthotropic") || material.has("young_modulus_pa") || material.has("poisson_ratio") ||
         material.has("lame_lambda_pa") || material.has("lame_mu_pa");
}

/// Base material of "from".
Material read_from(base::Object& material, const MaterialTable* table, const std::string& fallback) {
  const std::string name = material.string_or("from", fallback);
  if (table == nullptr) material.fail("from", "a material of this table cannot start from another; give its constants");
  Material result = table->require(material.find_place("from"), name).material;
  result.place = material.find_place("");
  return result;
}

}  // namespace

namespace {

/// fallback: default of "from" for objects without constants of their own; empty: none.
Material read_one(base::Object material, const std::array<double, 2>& band_hz, std::vector<std::string>& warnings,
                  const MaterialTable* table, const std::string& fallback) {
  Material result;
  const bool is_derived = material.has("from") || (!fallback.empty() && !has_elasticity(material) && !material.has("density_kg_m3"));
  if (is_derived) result = read_from(material, table, fallback);
  result.place = material.find_place("");
  const bool has_stiffness = !is_derived || has_elasticity(material), has_density = !is_derived || material.has("density_kg_m3");
  if (has_stiffness) {
    result.orthotropic.reset();
    read_elasticity(material, result);
  } else if (material.has("axes")) {
    if (!result.orthotropic)
      material.fail("axes", fmt::format("\"{}\" is the same in all directions and needs no axes; remove them", result.name));
    read_axes(material, *result.orthotropic);
  }
  if (has_density) result.density_kg_m3 = read_positive(material, "density_kg_m3", kMaxDensityKgM3);
  if (!is_derived && !material.has("damping"))
    material.fail("",
                  "\"damping\" is missing; give a law, such as {\"internal_friction\": {\"tan_phi\": 1e-4}}, or take a known material: "
                  "\"material\": \"steel\"");
  const bool has_damping = material.has("damping");
  if (has_damping) read_damping(material.object("damping"), result, band_hz);
  if (has_stiffness || has_density) ask_about_units(material, result, warnings);
  if (has_damping) ask_about_damping(material, result, band_hz, warnings);
  if (material.has_string("name")) result.name = material.string_or("name", "");
  material.ignore("name");
  material.finish();
  return result;
}

}  // namespace

Material read_material(base::Object material, const std::array<double, 2>& band_hz, std::vector<std::string>& warnings,
                       const MaterialTable* table) {
  return read_one(std::move(material), band_hz, warnings, table, "");
}

Material read_material(base::Object& parent, std::string_view key, const std::array<double, 2>& band_hz, std::vector<std::string>& warnings,
                       const std::string& fallback) {
  const bool is_missing = !parent.has(key) && !fallback.empty();
  if (!is_missing && !parent.has_string(key)) return read_one(parent.object(key), band_hz, warnings, &MaterialTable::get(), fallback);
  const std::string name = is_missing ? fallback : parent.string(key);
  Material result = MaterialTable::get().require(parent.find_place(key), name).material;
  result.place = parent.find_place(key);
  return result;
}

}  // namespace carillon::material
