// Method: K is linear in the Lame constants, M in the density; scaling lengths by g scales K by g and M by g^3. With scales s, k, g of
//   density, stiffness and size: lambda' = lambda k / (s g^2), phi' = phi / sqrt(s g^3). The flow of the radiation gain, the integral of
//   |phi . n| over the surface, scales with phi' g^2; its frequency dependence is recomputed.
//   Multipoles of size g, same material: omega' = omega / g, so k' = k / g and k' R' = k R with R' = g R. The pressure p' at g x solves the
//   same equation with dp'/dn = i omega' rho phi' on the surface. With p' = b p: b / g dp/dn = i (omega / g) rho g^(-3/2) phi, so
//   b = g^(-3/2): coefficients (pressures on the sphere) scale with g^(-3/2). Decay, sum |c|^2 / (2 rho c k^2): g^(-3) g^2 = 1 / g. Added
//   mass, integral of p / (i omega) times phi: g^(-3/2) g g^(-3/2) g^2 = 1. Frequencies in air, f / sqrt(1 + added mass): 1 / g.
// Source: docs/equations.md E6, E7, E10, E12.
#include "runtime/bank/edits.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <iterator>
#include <numbers>
#include <string_view>

#include "runtime/bank/air.hpp"
#include "runtime/bank/radiation_gain.hpp"
#include "runtime/bank/select.hpp"
#include "runtime/base/sort_order.hpp"

namespace carillon::bank {
namespace {

constexpr double kMaxPower = 8.0;
constexpr double kMaxLossFactor = 2.0;  // d = omega eta / 2: critical damping at any frequency

void check_loss(double loss) {
  if (!(loss >= 0.0 && loss < kMaxLossFactor))
    throw InputError(
        fmt::format("a loss factor is 0 or more and below {:g}, and this one is {:g}; steel has 1e-4, wood 0.01, soft rubber up to 1",
                    kMaxLossFactor, loss));
}

/// Throws InputError unless the law gives the decay at any frequency.
void check_law(const Damping& law) {
  if (law.law == "internal_friction" && law.coefficient.size() == 1) return check_loss(law.coefficient[0]);
  if (law.law == "caughey" && !law.coefficient.empty() && law.coefficient.size() == law.power.size()) {
    for (std::size_t j = 0; j < law.power.size(); ++j) {
      if (!std::isfinite(law.coefficient[j]) || !(std::abs(law.power[j]) <= kMaxPower))
        throw InputError(fmt::format("a term of the damping is {:g} lambda^{:g}; powers lie within +-{:g}", law.coefficient[j],
                                     law.power[j], kMaxPower));
    }
    return;
  }
  if (law.law == "loss_table" && !law.freq_hz.empty() && law.freq_hz.size() == law.loss_factor.size()) {
    for (std::size_t i = 0; i < law.freq_hz.size(); ++i) {
      check_loss(law.loss_factor[i]);
      if (!(law.freq_hz[i] > (i == 0 ? 0.0 : law.freq_hz[i - 1])) || !std::isfinite(law.freq_hz[i]))
        throw InputError(fmt::format("the frequencies of a loss table are above 0 and ascend, and {:g} Hz is not", law.freq_hz[i]));
    }
    return;
  }
  throw InputError(fmt::format("\"{}\" with these numbers is no damping law", law.law));
}

void check(const Bank& bank, const Edits& edits) {
  for (const auto& [name, scale] :
       {std::pair{"density", edits.density_scale}, {"stiffness", edits.stiffness_scale}, {"size", edits.size_scale}}) {
    if (!(scale >= 1e-6 && scale <= 1e6))
      throw InputError(fmt::format("the scale of the {} is {}; it must lie within 1e-6 and 1e6", name, scale));
  }
  if (edits.alphas) {
    for (const double alpha : *edits.alphas) {
      if (!(alpha >= 0.0) || !std::isfinite(alpha))
        throw InputError(fmt::format("a damping of alpha {} is invalid; alphas are not negative", alpha));
    }
  }
  if (edits.damping) {
    if (edits.alphas) throw InputError("a body has one damping law; give alphas or another law, not both");
    check_law(*edits.damping);
  }
  const bool is_of_size = edits.density_scale == 1.0 && edits.stiffness_scale == 1.0 && !edits.alphas && !edits.damping;
  if (bank.damping.law == "mixed" || (!bank.regions.empty() && !is_of_size)) {
    throw InputError(
        "the bank is of a body of several materials, or of one that is not the same in all directions, which one density, stiffness or "
        "damping does not describe; change the materials of its job and compute the bank again");
  }
}

/// (m) factor of each eigenvalue by the cuts.
std::vector<double> calc_cut_scales(const Bank& bank, const std::vector<Cut>& cuts) {
  std::vector<double> scales(bank.mode_count(), 1.0);
  if (cuts.empty()) return scales;
  if (bank.sensitivities.is_empty())
    throw InputError("the bank has no sensitivities, which cuts need; compute it again with \"sensitivities\": 30 in its job");
  for (const Cut& cut : cuts)
    if (!(cut.radius_m > 0.0 && cut.depth_m >= 0.0 && std::isfinite(cut.radius_m + cut.depth_m + norm(cut.at_m))))
      throw InputError("a cut needs a place, a radius above 0 and a depth of 0 or more, in metres");
  const std::vector<double> cents = calc_changes(bank, calc_depth(bank, cuts));
  for (std::size_t m = 0; m < cents.size(); ++m) scales[m] = std::exp2(cents[m] / 600.0);
  return scales;
}

/// True if the edit changes the ratio of wavelength in air to size.
bool changes_waves(const Edits& edits) { return edits.density_scale != 1.0 || edits.stiffness_scale != 1.0; }

/// Bank::regions with scaled volumes.
std::string scale_volumes(const std::string& regions, double scale) {
  constexpr std::string_view kKey = "\"volume_m3\":";
  std::string scaled;
  std::size_t done = 0;
  for (std::size_t at = regions.find(kKey); at != std::string::npos; at = regions.find(kKey, done)) {
    at = std::min(regions.find_first_not_of(' ', at + kKey.size()), regions.size());
    scaled.append(regions, done, at - done);
    char* rest = nullptr;
    const double volume_m3 = scale * std::strtod(regions.c_str() + at, &rest);
    const bool is_number = rest != regions.c_str() + at && std::isfinite(volume_m3);
    if (is_number) scaled += fmt::format("{}", volume_m3);
    done = is_number ? static_cast<std::size_t>(rest - regions.c_str()) : at;
  }
  return scaled.append(regions, done);
}

std::string format_list(const char* name, const std::vector<double>& values) {
  std::string text;
  for (const double value : values) fmt::format_to(std::back_inserter(text), "{}{}", text.empty() ? "" : ", ", value);
  return values.empty() ? text : fmt::format(R"(, "{}": [{}])", name, text);
}

/// Damping law as JSON, for the provenance.
std::string format_law(const Damping& law) {
  return fmt::format(R"(, "damping": {{"law": "{}"{}{}{}{}}})", law.law, format_list("coefficient", law.coefficient),
                     format_list("power", law.power), format_list("freq_hz", law.freq_hz), format_list("loss_factor", law.loss_factor));
}

}  // namespace

std::string describe_dropped(const Bank& bank, const Edits& edits) {
  if (!changes_waves(edits) || bank.multipoles.is_empty()) return {};
  return "radiation: dropped, as modes of another density or stiffness meet the air at other wave numbers; for the edited body's own, "
         "compute its job again";
}

Bank calc_edited(const Bank& bank, const Edits& edits) {
  check(bank, edits);
  const double s = edits.density_scale, k = edits.stiffness_scale, g = edits.size_scale;
  const double eigenvalue_scale = k / (s * g * g);
  const double shape_scale = 1.0 / std::sqrt(s * g * g * g);
  const double freq_scale = std::sqrt(eigenvalue_scale);
  const double area = calc_outer_area_m2(bank);
  const std::vector<double> cut_scale = calc_cut_scales(bank, edits.cuts);
  Bank edited = bank;
  edited.packing.reset();
  if (changes_waves(edits))
    edited.multipoles = {};
  else
    scale_size(edited.multipoles, g);
  scale_energy(edited.quartic, s, k, g);
  for (double& x : edited.sensitivities.scale) x /= g * g * g;
  for (float& area_m2 : edited.sensitivities.area_m2) area_m2 *= static_cast<float>(g * g);
  const Multipoles& air = edited.multipoles;
  edited.material.young_modulus_pa *= k;
  edited.material.density_kg_m3 *= s;
  if (edits.alphas) {
    edited.damping = Damping{};
    edited.material.alpha1_s = (*edits.alphas)[0];
    edited.material.alpha2_per_s = (*edits.alphas)[1];
  }
  if (edits.damping) {
    edited.damping = *edits.damping;
    edited.material.alpha1_s = edited.material.alpha2_per_s = 0.0;
  }
  for (std::size_t m = 0; m < bank.mode_count(); ++m) {
    edited.eigenvalue_rad2_s2[m] *= eigenvalue_scale * cut_scale[m];
    edited.decay_per_s[m] = calc_decay(edited.damping, edited.material, edited.eigenvalue_rad2_s2[m]);
    if (!(edited.decay_per_s[m] >= 0.0) || !std::isfinite(edited.decay_per_s[m]))
      throw InputError(fmt::format("the damping makes mode {} ({:.5g} Hz) decay by {:.3g} 1/s, which is invalid; check its numbers", m + 1,
                                   edited.freq_hz(m), edited.decay_per_s[m]));
    if (Corrected& corrected = edited.corrected; !corrected.is_empty()) {
      const double omega = 2.0 * std::numbers::pi * (corrected.freq_hz[m] *= freq_scale * std::sqrt(cut_scale[m]));
      corrected.decay_per_s[m] = calc_decay(edited.damping, edited.material, omega * omega);
    }
    if (!edited.multipoles.is_empty()) edited.multipoles.freq_hz[m] *= std::sqrt(cut_scale[m]);
    edited.shape_scale[m] *= shape_scale;
    edited.radiation_gain[m] *= calc_radiation_gain(std::sqrt(edited.eigenvalue_rad2_s2[m]), shape_scale * g * g, area * g * g) /
                                calc_radiation_gain(std::sqrt(bank.eigenvalue_rad2_s2[m]), 1.0, area);
    if (air.is_in_decay) edited.decay_per_s[m] += air.decay_per_s[m];
  }
  if (air.is_in_decay) edited.radiation_gain = calc_far_gains(air);  // keep the form of choose_frequencies()
  for (Vec3& vertex : edited.vertices_m) {
    for (double& x : vertex) x *= g;
  }
  // Reaction: lambda times mass times phi; a couple has one more length.
  const double reaction_scale = eigenvalue_scale * std::sqrt(s * g * g * g);
  for (std::size_t i = 0; i < edited.supports.reaction.size(); ++i)
    edited.supports.reaction[i] *= i % 6 < 3 ? reaction_scale : reaction_scale * g;
  for (Vec3& centre : edited.supports.centre_m)
    for (double& x : centre) x *= g;
  for (double& area : edited.supports.area_m2) area *= g * g;
  for (double& thickness : edited.supports.thickness_m) thickness *= g;
  edited.regions = scale_volumes(bank.regions, g * g * g);
  edited.rigid.mass_kg *= s * g * g * g;
  edited.rigid.volume_m3 *= g * g * g;
  for (double& x : edited.rigid.centre_m) x *= g;
  for (double& x : edited.rigid.inertia_kg_m2) x *= s * std::pow(g, 5);
  for (double& freq : edited.band_hz) freq *= freq_scale;
  if (edited.proof) {
    for (double& cut : edited.proof->cut_hz) cut *= freq_scale;
    for (double& below : edited.proof->below_band_hz) below *= freq_scale;
    edited.proof->complete_below_hz *= freq_scale;
  }
  edited.provenance = fmt::format(R"({{"edits": {{"density_scale": {}, "stiffness_scale": {}, "size_scale": {})", s, k, g);
  if (edits.alphas) edited.provenance += fmt::format(R"(, "alpha1_s": {}, "alpha2_per_s": {})", (*edits.alphas)[0], (*edits.alphas)[1]);
  if (edits.damping) edited.provenance += format_law(*edits.damping);
  if (!describe_dropped(bank, edits).empty()) edited.provenance += R"(, "radiation": "dropped")";
  if (!edits.cuts.empty()) edited.provenance += fmt::format(R"(, "cuts": {})", edits.cuts.size());
  edited.provenance += bank.provenance.empty() ? "}}" : fmt::format(R"(}}, "of": {}}})", bank.provenance);
  if (!std::is_sorted(edited.eigenvalue_rad2_s2.begin(), edited.eigenvalue_rad2_s2.end()))  // a cut lets modes change places
    select_modes(edited, base::find_sort_order(edited.eigenvalue_rad2_s2));
  return edited;
}

}  // namespace carillon::bank
