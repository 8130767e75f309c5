#include "runtime/bank/of_material.hpp"

#include <fmt/format.h>

#include <cmath>

namespace carillon::bank {

Damping make_damping(const material::Material& material) {
  Damping damping;
  switch (material.law) {
    case material::DampingLaw::rayleigh:
      damping.law = "rayleigh";
      break;
    case material::DampingLaw::internal_friction:
      damping.law = "internal_friction";
      damping.coefficient = {material.tan_phi};
      break;
    case material::DampingLaw::caughey:
      damping.law = "caughey";
      for (const material::CaugheyTerm& term : material.caughey) {
        damping.coefficient.push_back(term.coefficient);
        damping.power.push_back(term.power);
      }
      break;
    case material::DampingLaw::loss_table:
      damping.law = "loss_table";
      for (const material::LossRow& row : material.loss_table) {
        damping.freq_hz.push_back(row.freq_hz);
        damping.loss_factor.push_back(row.loss_factor);
      }
      break;
  }
  return damping;
}

Edits make_edits(const Bank& bank, const material::Material& material) {
  if (material.orthotropic)
    throw InputError(
        fmt::format("{} is not the same in all directions, which no scale makes of another material; change the material of the job and "
                    "compute the bank again",
                    material.name));
  Edits edits;
  edits.density_scale = material.density_kg_m3 / bank.material.density_kg_m3;
  edits.stiffness_scale = material.young_modulus_pa / bank.material.young_modulus_pa;
  if (material.law == material::DampingLaw::rayleigh)
    edits.alphas = {material.alpha1_s, material.alpha2_per_s};
  else
    edits.damping = make_damping(material);
  return edits;
}

double calc_poisson_cents(const Bank& bank, const material::Material& material) {
  return std::abs(600.0 * std::log2((1.0 + material.poisson_ratio) / (1.0 + bank.material.poisson_ratio)));
}

}  // namespace carillon::bank
