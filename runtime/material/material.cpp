// Method: compliance from the nine constants, inverted and rotated to mesh axes as a fourth-order tensor; Voigt, Reuss and Hill averages;
//   damping laws as functions of lambda, weighted by the energy shares of a mode.
// Source: Lekhnitskii 1981, "Theory of elasticity of an anisotropic body", section 3 (orthotropy); Hill 1952, Proc. Phys. Soc. A 65, 349;
//   OSG02 section 3.3; vdDP96; Caughey 1960, J. Appl. Mech. 27, 269; Ungar and Kerwin 1962, J. Acoust. Soc. Am. 34, 954 (energy shares).
// Deviations: a term of a Caughey series is weighted by the elastic energy for powers from 1/2 on, by the kinetic energy below, so that the
//   powers 1, 1/2 and 0 are Rayleigh's alpha1, internal friction and Rayleigh's alpha2.
#include "runtime/material/material.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace carillon::material {
namespace {

using Square3 = std::array<std::array<double, 3>, 3>;

/// Voigt index of the pair (i, j).
constexpr int kVoigt[3][3] = {{0, 5, 4}, {5, 1, 3}, {4, 3, 2}};

Square3 invert(const Square3& a) {
  Square3 inverse{};
  double determinant = 0.0;
  for (int i = 0; i < 3; ++i) {
    const int j = (i + 1) % 3, k = (i + 2) % 3;
    determinant += a[0][i] * (a[1][j] * a[2][k] - a[1][k] * a[2][j]);
    for (int r = 0; r < 3; ++r) {
      const int s = (r + 1) % 3, t = (r + 2) % 3;
      inverse[i][r] = a[s][j] * a[t][k] - a[s][k] * a[t][j];
    }
  }
  for (auto& row : inverse)
    for (double& value : row) value /= determinant;
  return inverse;
}

Square3 calc_compliance(const Orthotropic& o) {
  const auto& e = o.young_modulus_pa;
  const auto& nu = o.poisson_ratio;  // nu12, nu23, nu13
  const double s12 = -nu[0] / e[0], s23 = -nu[1] / e[1], s13 = -nu[2] / e[0];
  return {{{1 / e[0], s12, s13}, {s12, 1 / e[1], s23}, {s13, s23, 1 / e[2]}}};
}

/// C in the material axes 1, 2, 3.
Elasticity calc_own(const Orthotropic& o) {
  const Square3 normal = invert(calc_compliance(o));
  Elasticity c{};
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) c[6 * i + j] = (normal[i][j] + normal[j][i]) / 2;
  c[6 * 3 + 3] = o.shear_modulus_pa[1];
  c[6 * 4 + 4] = o.shear_modulus_pa[2];
  c[6 * 5 + 5] = o.shear_modulus_pa[0];
  return c;
}

/// C'_ijkl = a_pi a_qj a_rk a_sl C_pqrs, a[p]: material axis p in mesh axes.
Elasticity turn(const Elasticity& own, const Square3& a) {
  constexpr int kPairs[6][2] = {{0, 0}, {1, 1}, {2, 2}, {1, 2}, {0, 2}, {0, 1}};
  Elasticity turned{};
  for (int row = 0; row < 6; ++row)
    for (int column = row; column < 6; ++column) {
      const int i = kPairs[row][0], j = kPairs[row][1], k = kPairs[column][0], l = kPairs[column][1];
      double sum = 0.0;
      for (int p = 0; p < 3; ++p)
        for (int q = 0; q < 3; ++q)
          for (int r = 0; r < 3; ++r)
            for (int s = 0; s < 3; ++s) sum += a[p][i] * a[q][j] * a[r][k] * a[s][l] * own[6 * kVoigt[p][q] + kVoigt[r][s]];
      turned[6 * row + column] = turned[6 * column + row] = sum;
    }
  return turned;
}

/// Bulk and shear modulus of the closest isotropic solid.
struct Moduli {
  double bulk_pa = 0.0, shear_pa = 0.0;
};

/// Orientation averages: Voigt (equal strain), Reuss (equal stress).
std::array<Moduli, 2> calc_bounds(const Material& material) {
  if (!material.orthotropic) {
    const Moduli m{material.young_modulus_pa / (3 * (1 - 2 * material.poisson_ratio)), material.lame_mu_pa()};
    return {m, m};
  }
  const Elasticity c = calc_own(*material.orthotropic);
  const Square3 s = calc_compliance(*material.orthotropic);
  const double s_diagonal = s[0][0] + s[1][1] + s[2][2], s_off = s[0][1] + s[0][2] + s[1][2];
  double s_shear = 0.0;
  for (const double g : material.orthotropic->shear_modulus_pa) s_shear += 1 / g;
  return {Moduli{(c[0] + c[7] + c[14] + 2 * (c[1] + c[2] + c[8])) / 9, calc_mean_shear_pa(c)},
          Moduli{1 / (s_diagonal + 2 * s_off), 15 / (4 * s_diagonal - 4 * s_off + 3 * s_shear)}};
}

/// Linear in log f, constant extrapolation.
double find_loss_factor(const std::vector<LossRow>& table, double freq_hz) {
  const auto above = std::upper_bound(table.begin(), table.end(), freq_hz, [](double f, const LossRow& row) { return f < row.freq_hz; });
  if (above == table.begin()) return table.front().loss_factor;
  if (above == table.end()) return table.back().loss_factor;
  const LossRow &low = *(above - 1), &high = *above;
  const double part = std::log(freq_hz / low.freq_hz) / std::log(high.freq_hz / low.freq_hz);
  return low.loss_factor + part * (high.loss_factor - low.loss_factor);
}

}  // namespace

// Jacobi rotations (Golub and Van Loan, section 8.5).
std::array<double, 6> calc_eigenvalues(const Elasticity& elasticity_pa) {
  Elasticity a = elasticity_pa;  // Kelvin form (shear rows and columns times sqrt(2)): eigenvalues independent of the axes
  for (int i = 0; i < 6; ++i)
    for (int j = 0; j < 6; ++j) a[6 * i + j] *= (i < 3 ? 1.0 : std::numbers::sqrt2) * (j < 3 ? 1.0 : std::numbers::sqrt2);
  for (int sweep = 0; sweep < 30; ++sweep)
    for (int p = 0; p < 6; ++p)
      for (int q = p + 1; q < 6; ++q) {
        if (a[6 * p + q] == 0.0) continue;
        const double theta = (a[6 * q + q] - a[6 * p + p]) / (2 * a[6 * p + q]);
        const double t = std::copysign(1.0, theta) / (std::abs(theta) + std::hypot(theta, 1.0));
        const double c = 1 / std::hypot(t, 1.0), s = t * c;
        for (int k = 0; k < 6; ++k) {
          const double kp = a[6 * k + p], kq = a[6 * k + q];
          a[6 * k + p] = c * kp - s * kq;
          a[6 * k + q] = s * kp + c * kq;
        }
        for (int k = 0; k < 6; ++k) {
          const double pk = a[6 * p + k], qk = a[6 * q + k];
          a[6 * p + k] = c * pk - s * qk;
          a[6 * q + k] = s * pk + c * qk;
        }
      }
  std::array<double, 6> values{};
  for (int i = 0; i < 6; ++i) values[i] = a[7 * i];
  std::sort(values.begin(), values.end());
  return values;
}

Elasticity Material::calc_elasticity_pa() const {
  if (orthotropic) return turn(calc_own(*orthotropic), orthotropic->axes);
  Elasticity c{};
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) c[6 * i + j] = lame_lambda_pa() + (i == j ? 2 * lame_mu_pa() : 0.0);
    c[7 * (3 + i)] = lame_mu_pa();
  }
  return c;
}

double Material::calc_damping_per_s(double lambda_rad2_s2) const { return calc_damping_per_s(lambda_rad2_s2, 1.0, 1.0); }

double Material::calc_damping_per_s(double lambda_rad2_s2, double elastic, double kinetic) const {
  const double omega = std::sqrt(lambda_rad2_s2);
  switch (law) {
    case DampingLaw::rayleigh:
      return alpha1_s * lambda_rad2_s2 * elastic + alpha2_per_s * kinetic;
    case DampingLaw::internal_friction:
      return tan_phi * omega * elastic;
    case DampingLaw::loss_table:
      return find_loss_factor(loss_table, omega / (2 * std::numbers::pi)) * omega * elastic;
    case DampingLaw::caughey:
      break;
  }
  double sum = 0.0;
  for (const CaugheyTerm& term : caughey)
    sum += term.coefficient * std::pow(lambda_rad2_s2, term.power) * (term.power >= 0.5 ? elastic : kinetic);
  return sum;
}

std::string Material::describe_damping() const {
  switch (law) {
    case DampingLaw::rayleigh:
      return fmt::format("Rayleigh, alpha1 {:.12g} s, alpha2 {:.12g} 1/s", alpha1_s, alpha2_per_s);
    case DampingLaw::internal_friction:
      return fmt::format("internal friction, tan(phi) {:.12g}", tan_phi);
    case DampingLaw::loss_table:
      return fmt::format("loss table, {} row{} from {:.6g} Hz (loss factor {:.6g}) to {:.6g} Hz ({:.6g})", loss_table.size(),
                         loss_table.size() == 1 ? "" : "s", loss_table.front().freq_hz, loss_table.front().loss_factor,
                         loss_table.back().freq_hz, loss_table.back().loss_factor);
    case DampingLaw::caughey:
      break;
  }
  std::string text = "Caughey series,";
  for (std::size_t i = 0; i < caughey.size(); ++i)
    text += fmt::format("{} {:.12g} lambda^{:g}", i == 0 ? "" : " +", caughey[i].coefficient, caughey[i].power);
  return text;
}

Equivalent calc_equivalent(std::span<const Material> materials, std::span<const double> volume_m3) {
  double volume = 0.0, mass = 0.0;
  Moduli voigt, reuss;  // Reuss: sums of reciprocals
  for (std::size_t i = 0; i < materials.size(); ++i) {
    const auto [stiff, soft] = calc_bounds(materials[i]);
    volume += volume_m3[i];
    mass += volume_m3[i] * materials[i].density_kg_m3;
    voigt.bulk_pa += volume_m3[i] * stiff.bulk_pa;
    voigt.shear_pa += volume_m3[i] * stiff.shear_pa;
    reuss.bulk_pa += volume_m3[i] / soft.bulk_pa;
    reuss.shear_pa += volume_m3[i] / soft.shear_pa;
  }
  const double bulk = (voigt.bulk_pa / volume + volume / reuss.bulk_pa) / 2,
               shear = (voigt.shear_pa / volume + volume / reuss.shear_pa) / 2;
  return {9 * bulk * shear / (3 * bulk + shear), (3 * bulk - 2 * shear) / (2 * (3 * bulk + shear)), mass / volume};
}

double calc_mean_shear_pa(const Elasticity& c) { return (c[0] + c[7] + c[14] - c[1] - c[2] - c[8] + 3 * (c[21] + c[28] + c[35])) / 15; }

double calc_definiteness(const Elasticity& elasticity_pa) {
  const auto values = calc_eigenvalues(elasticity_pa);
  return values.front() / values.back();
}

}  // namespace carillon::material
