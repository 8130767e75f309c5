// Method: isotropic: K = lambda K_l + mu K_m is linear in Lame's constants. Orthotropic: central differences of phi^T K phi.
#include "precompute/fem/derivatives.hpp"

#include <array>
#include <utility>

#include "precompute/fem/energy.hpp"

namespace carillon::fem {
namespace {

using Energies = std::vector<double>;  // (n) phi^T K phi

/// (n) d ln f / d nu.
Energies calc_by_poisson_ratio(const material::Material& material, const Energies& shear, std::span<const double> lambda) {
  const double e = material.young_modulus_pa, nu = material.poisson_ratio;
  const double lame = material.lame_lambda_pa(), mu = material.lame_mu_pa();
  const double mu_by_nu = -e / (2 * (1 + nu) * (1 + nu));
  const double lame_by_nu = e * (1 + 2 * nu * nu) / ((1 + nu) * (1 + nu) * (1 - 2 * nu) * (1 - 2 * nu));
  Energies values;
  for (std::size_t j = 0; j < lambda.size(); ++j) {
    const double volume = lame != 0.0 ? (lambda[j] - shear[j]) / lame * lame_by_nu : 0.0;
    values.push_back(0.5 * (volume + shear[j] / mu * mu_by_nu) / lambda[j]);
  }
  return values;
}

}  // namespace

Derivatives calc_derivatives(const comm::Communicator& comm, const mesh::LocalMesh& local, const material::Material& material,
                             job::Mass mass, std::span<const double> lambda, Mat shapes) {
  const auto calc_energies = [&](const material::Material& changed) {
    return calc_forms(comm, assemble(comm, local, changed, mass).stiffness, shapes, std::ssize(lambda));
  };
  std::vector<std::pair<std::string, Energies>> columns;
  const auto add_constant = [&](const char* name, double value) { columns.emplace_back(name, Energies(lambda.size(), value)); };
  if (!material.orthotropic) {
    add_constant("young_modulus_pa", 0.5);
    material::Material shear = material;
    shear.young_modulus_pa = 2 * material.lame_mu_pa();
    shear.poisson_ratio = 0.0;
    columns.emplace_back("poisson_ratio", calc_by_poisson_ratio(material, calc_energies(shear), lambda));
  } else {
    constexpr double kStep = 1e-3;
    const std::array<std::array<const char*, 3>, 3> names{{{"young_modulus_pa.1", "young_modulus_pa.2", "young_modulus_pa.3"},
                                                           {"shear_modulus_pa.12", "shear_modulus_pa.23", "shear_modulus_pa.13"},
                                                           {"poisson_ratio.12", "poisson_ratio.23", "poisson_ratio.13"}}};
    for (std::size_t kind = 0; kind < 3; ++kind)
      for (std::size_t k = 0; k < 3; ++k) {
        std::array<Energies, 2> moved;
        for (const std::size_t side : {0U, 1U}) {
          material::Material changed = material;
          material::Orthotropic& o = *changed.orthotropic;
          double& value = (kind == 0 ? o.young_modulus_pa : kind == 1 ? o.shear_modulus_pa : o.poisson_ratio)[k];
          if (kind < 2)
            value *= side == 0 ? 1 - kStep : 1 + kStep;
          else
            value += side == 0 ? -kStep : kStep;
          moved[side] = calc_energies(changed);
        }
        Energies values;
        for (std::size_t j = 0; j < lambda.size(); ++j) values.push_back(0.5 * (moved[1][j] - moved[0][j]) / (2 * kStep * lambda[j]));
        columns.emplace_back(names[kind][k], std::move(values));
      }
  }
  add_constant("density_kg_m3", -0.5);
  add_constant("size", -1.0);
  Derivatives result;
  for (const auto& [name, values] : columns) result.parameters.push_back(name);
  for (std::size_t j = 0; j < lambda.size(); ++j)
    for (const auto& [name, values] : columns) result.values.push_back(values[j]);
  return result;
}

}  // namespace carillon::fem
