// A material: density, elasticity (isotropic or orthotropic) and one damping law. Equations: docs/equations.md, elasticity and damping.
#pragma once

#include <array>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace carillon::material {

/// Symmetric (6, 6), row-major, in Voigt's order xx, yy, zz, yz, xz, xy with engineering shear strains: stress = C strain.
using Elasticity = std::array<double, 36>;

/// Nine constants of a solid with three perpendicular planes of symmetry, such as wood. nu_ij is the contraction along j under a pull
/// along i, so that nu_ij / E_i = nu_ji / E_j.
struct Orthotropic {
  std::array<double, 3> young_modulus_pa{};                                      // E1, E2, E3
  std::array<double, 3> shear_modulus_pa{};                                      // G12, G23, G13
  std::array<double, 3> poisson_ratio{};                                         // nu12, nu23, nu13
  std::array<std::array<double, 3>, 3> axes{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};  // unit vectors 1, 2, 3 in the axes of the mesh
};

/// How a mode of eigenvalue lambda = omega^2 loses its energy: q'' + c q' + lambda q = 0, decay rate d = c / 2.
enum class DampingLaw {
  rayleigh,           // c = alpha1 lambda + alpha2 (OSG02 section 3.3)
  internal_friction,  // c = omega tan(phi) (vdDP96)
  caughey,            // c = sum_j a_j lambda^p_j (Caughey 1960)
  loss_table,         // c = omega eta(f), eta interpolated linearly in log f, constant beyond the ends
};

/// One term of a Caughey series.
struct CaugheyTerm {
  double power = 0.0;        // p
  double coefficient = 0.0;  // a [s^(2 p - 1)]
};

/// One row of a table of loss factors.
struct LossRow {
  double freq_hz = 0.0;
  double loss_factor = 0.0;  // eta, the part of the elastic energy that is lost in a radian
};

/// Young's modulus and Poisson's ratio are derived where the job gives Lame's constants; of an orthotropic material they are those of the
/// isotropic solid nearest to it (Hill's average of all orientations), for code that needs one number.
struct Material {
  double young_modulus_pa = 0.0;
  double poisson_ratio = 0.0;
  double density_kg_m3 = 0.0;
  double alpha1_s = 0.0;      // of DampingLaw::rayleigh
  double alpha2_per_s = 0.0;  // of DampingLaw::rayleigh
  DampingLaw law = DampingLaw::rayleigh;
  double tan_phi = 0.0;                   // of DampingLaw::internal_friction
  std::vector<CaugheyTerm> caughey = {};  // of DampingLaw::caughey
  std::vector<LossRow> loss_table = {};   // of DampingLaw::loss_table, ascending in frequency
  std::optional<Orthotropic> orthotropic = {};
  std::string name = {};   // for people
  std::string place = {};  // "file:line" of the job, for messages

  double lame_lambda_pa() const { return young_modulus_pa * poisson_ratio / ((1 + poisson_ratio) * (1 - 2 * poisson_ratio)); }
  double lame_mu_pa() const { return young_modulus_pa / (2 * (1 + poisson_ratio)); }

  /// The elasticity matrix [Pa] in the axes of the mesh.
  Elasticity calc_elasticity_pa() const;
  /// c(lambda) [1/s] of a body that is all of this material. lambda > 0 [rad^2/s^2].
  double calc_damping_per_s(double lambda_rad2_s2) const;
  /// d = c / 2 [1/s] of a body that is all of this material.
  double calc_decay_per_s(double lambda_rad2_s2) const { return calc_damping_per_s(lambda_rad2_s2) / 2; }
  /// c(lambda) of a body of which this material holds `elastic` of the mode's elastic energy and `kinetic` of its kinetic energy (parts of
  /// 1); the sum over the materials is the mode's c. What a law draws from which energy: docs/equations.md, damping.
  double calc_damping_per_s(double lambda_rad2_s2, double elastic, double kinetic) const;
  /// The law with its constants on one line: "Rayleigh, alpha1 1e-07 s, alpha2 0.5 1/s".
  std::string describe_damping() const;
};

/// One number for each of what a body of several materials has many of.
struct Equivalent {
  double young_modulus_pa = 0.0;
  double poisson_ratio = 0.0;
  double density_kg_m3 = 0.0;
};

/// The isotropic solid nearest to a mixture: Hill's mean of Voigt's and Reuss' averages of the bulk and shear moduli by volume (Hill 1952),
/// and the mean density. `volume_m3` has one positive entry a material.
Equivalent calc_equivalent(std::span<const Material> materials, std::span<const double> volume_m3);

/// The eigenvalues of C in Kelvin's form [Pa], ascending: how stiff the solid is in its six own strains, the same for any axes.
std::array<double, 6> calc_eigenvalues(const Elasticity& elasticity_pa);

/// The shear modulus of C by Voigt's average over all orientations.
double calc_mean_shear_pa(const Elasticity& elasticity_pa);

/// The least eigenvalue of C over the greatest; a material is refused below 1e-9.
double calc_definiteness(const Elasticity& elasticity_pa);

}  // namespace carillon::material
