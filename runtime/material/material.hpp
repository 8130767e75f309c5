// Material: density, elasticity (isotropic or orthotropic) and a damping law. Equations: docs/equations.md, elasticity and damping.
#pragma once

#include <array>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace carillon::material {

/// Symmetric (6, 6), row-major, in Voigt's order xx, yy, zz, yz, xz, xy with engineering shear strains: stress = C strain.
using Elasticity = std::array<double, 36>;

/// Nine constants of an orthotropic solid such as wood. nu_ij: contraction along j under tension along i; nu_ij / E_i = nu_ji / E_j.
struct Orthotropic {
  std::array<double, 3> young_modulus_pa{};                                      // E1, E2, E3
  std::array<double, 3> shear_modulus_pa{};                                      // G12, G23, G13
  std::array<double, 3> poisson_ratio{};                                         // nu12, nu23, nu13
  std::array<std::array<double, 3>, 3> axes{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};  // unit vectors 1, 2, 3 in mesh axes
};

/// Damping of a mode with eigenvalue lambda = omega^2: q'' + c q' + lambda q = 0, decay rate d = c / 2.
enum class DampingLaw {
  rayleigh,           // c = alpha1 lambda + alpha2 (OSG02 section 3.3)
  internal_friction,  // c = omega tan(phi) (vdDP96)
  caughey,            // c = sum_j a_j lambda^p_j (Caughey 1960)
  loss_table,         // c = omega eta(f), eta linear in log f, constant extrapolation
};

/// Term of a Caughey series.
struct CaugheyTerm {
  double power = 0.0;        // p
  double coefficient = 0.0;  // a [s^(2 p - 1)]
};

/// Row of a loss factor table.
struct LossRow {
  double freq_hz = 0.0;
  double loss_factor = 0.0;  // eta, fraction of elastic energy lost per radian
};

/// Young's modulus and Poisson's ratio are derived if the job gives Lame's constants; for an orthotropic material they are those of the
/// closest isotropic solid (Hill average over orientations), for code that needs scalars.
struct Material {
  double young_modulus_pa = 0.0;
  double poisson_ratio = 0.0;
  double density_kg_m3 = 0.0;
  double alpha1_s = 0.0;      // DampingLaw::rayleigh
  double alpha2_per_s = 0.0;  // DampingLaw::rayleigh
  DampingLaw law = DampingLaw::rayleigh;
  double tan_phi = 0.0;                   // DampingLaw::internal_friction
  std::vector<CaugheyTerm> caughey = {};  // DampingLaw::caughey
  std::vector<LossRow> loss_table = {};   // DampingLaw::loss_table, ascending in frequency
  std::optional<Orthotropic> orthotropic = {};
  std::string name = {};   // for display
  std::string place = {};  // "file:line" in the job, for messages

  double lame_lambda_pa() const { return young_modulus_pa * poisson_ratio / ((1 + poisson_ratio) * (1 - 2 * poisson_ratio)); }
  double lame_mu_pa() const { return young_modulus_pa / (2 * (1 + poisson_ratio)); }

  /// Elasticity matrix [Pa] in mesh axes.
  Elasticity calc_elasticity_pa() const;
  /// c(lambda) [1/s] of a body of this material. lambda > 0 [rad^2/s^2].
  double calc_damping_per_s(double lambda_rad2_s2) const;
  /// d = c / 2 [1/s] of a body of this material.
  double calc_decay_per_s(double lambda_rad2_s2) const { return calc_damping_per_s(lambda_rad2_s2) / 2; }
  /// Contribution to c(lambda) of a material that holds the fractions `elastic` and `kinetic` of the mode's energies; the mode's c is the
  /// sum over materials. Weights of each law: docs/equations.md, damping.
  double calc_damping_per_s(double lambda_rad2_s2, double elastic, double kinetic) const;
  /// Law and constants on one line: "Rayleigh, alpha1 1e-07 s, alpha2 0.5 1/s".
  std::string describe_damping() const;
};

/// Scalar equivalents of a body of several materials.
struct Equivalent {
  double young_modulus_pa = 0.0;
  double poisson_ratio = 0.0;
  double density_kg_m3 = 0.0;
};

/// Equivalent isotropic solid of a mixture: Hill mean of the Voigt and Reuss averages of bulk and shear moduli by volume (Hill 1952), and
/// mean density. `volume_m3`: one positive entry per material.
Equivalent calc_equivalent(std::span<const Material> materials, std::span<const double> volume_m3);

/// Eigenvalues of C in Kelvin form [Pa], ascending; independent of the axes.
std::array<double, 6> calc_eigenvalues(const Elasticity& elasticity_pa);

/// Voigt average of the shear modulus over all orientations.
double calc_mean_shear_pa(const Elasticity& elasticity_pa);

/// Ratio of the smallest to the largest eigenvalue of C; materials below 1e-9 are rejected.
double calc_definiteness(const Elasticity& elasticity_pa);

}  // namespace carillon::material
