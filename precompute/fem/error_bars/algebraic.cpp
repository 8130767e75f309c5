// Method: with r = K phi - lambda M phi and phi^T M phi = 1 an eigenvalue lies within rho = ||r||_{M^-1} of lambda. Both norms follow from
//   the known residual: ||r||_{M^-1} <= ||r||_2 / sqrt(least eigenvalue of M), ||M phi||_2 <= sqrt(greatest eigenvalue of M), and M lies
//   between multiples of its diagonal. k-th against k-th: modes with overlapping intervals form a group; its eigenvalues pair with those of
//   K phi = lambda M phi within sqrt(sum rho^2), or within sum rho^2 / gap if the gap to all other eigenvalues is wider. Rounding: relative
//   errors eps of |K_ij| move lambda by phi^T dK phi.
// Source: Fried 1972, SIAM J. Numer. Anal. 9, 448 (element eigenvalues bound those of the whole); Parlett 1998, The Symmetric Eigenvalue
//   Problem, ch. 10 and 11 (Kahan's bound for groups, Kato and Temple's for gaps).
// Deviations: the rounding term is a multiple of eps phi^T diag(K) phi, which has the right growth but is not a strict bound.
#include "precompute/fem/error_bars/algebraic.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include "precompute/fem/element.hpp"
#include "precompute/la/decompositions.hpp"
#include "precompute/petsc/handle.hpp"
#include "precompute/petsc/session.hpp"

namespace carillon::error_bars {
namespace {

MassBounds find_bounds(const la::Matrix& mass) {
  const la::Vector scale = mass.diagonal().cwiseSqrt().cwiseInverse();
  la::Matrix scaled = scale.asDiagonal() * mass * scale.asDiagonal();
  la::Vector values;
  if (la::calc_eigenpairs(scaled, values) != 0) return {0.0, std::numeric_limits<double>::infinity()};
  return {values[0], values[9]};
}

MassBounds find_element_bounds(const std::array<Vec3, 10>& x) {
  fem::ElementMatrices element;
  material::Material unit;
  unit.young_modulus_pa = unit.density_kg_m3 = 1.0;
  if (!fem::calc_element(x, unit, job::Mass::consistent, element)) return {0.0, std::numeric_limits<double>::infinity()};
  return find_bounds(Eigen::Map<const la::Matrix>(element.mass.data(), 10, 10));
}

/// det(dx / dL) of a quadratic element is a cubic, determined by twenty points; its Bernstein coefficients enclose it.
struct Cubic {
  static constexpr int kTerms = 20;
  std::vector<std::array<int, 4>> powers;
  la::Matrix to_bernstein;

  Cubic() {
    for (int i = 0; i <= 3; ++i)
      for (int j = 0; i + j <= 3; ++j)
        for (int k = 0; i + j + k <= 3; ++k) powers.push_back({i, j, k, 3 - i - j - k});
    la::Matrix values(kTerms, kTerms);
    constexpr std::array<double, 4> kFactorial{1, 1, 2, 6};
    for (int p = 0; p < kTerms; ++p)
      for (int t = 0; t < kTerms; ++t) {
        double value = 6;
        for (int i = 0; i < 4; ++i) value *= std::pow(powers[p][i] / 3.0, powers[t][i]) / kFactorial[powers[t][i]];
        values(p, t) = value;
      }
    to_bernstein = la::calc_inverse(values);
  }
};

/// Lower and upper bound of the Jacobian in the element.
std::array<double, 2> enclose_jacobian(const std::array<Vec3, 10>& x) {
  static const Cubic kCubic;
  Eigen::Matrix<double, Cubic::kTerms, 1> values;
  for (int p = 0; p < Cubic::kTerms; ++p) {
    std::array<double, 4> l;
    for (int i = 0; i < 4; ++i) l[i] = kCubic.powers[p][i] / 3.0;
    std::array<Vec3, 4> d{};  // derivative of x by L_i
    for (int k = 0; k < 3; ++k) {
      for (int i = 0; i < 4; ++i) d[i][k] = (4 * l[i] - 1) * x[i][k];
      for (int e = 0; e < 6; ++e) {
        const auto [a, b] = mesh::kEdges[e];
        d[a][k] += 4 * l[b] * x[4 + e][k];
        d[b][k] += 4 * l[a] * x[4 + e][k];
      }
    }
    for (int i = 1; i < 4; ++i)
      for (int k = 0; k < 3; ++k) d[i][k] -= d[0][k];
    values[p] = calc_det(d[1], d[2], d[3]);
  }
  const Eigen::Matrix<double, Cubic::kTerms, 1> coefficients = kCubic.to_bernstein * values;
  return {coefficients.minCoeff(), coefficients.maxCoeff()};
}

double to_cents(double lambda, double error) {
  constexpr double kNoUse = 1e6;  // larger bounds exclude no frequency
  return error < 0.999 * lambda ? std::min(kNoUse, -600.0 * std::log2(1.0 - error / lambda)) : kNoUse;
}

/// Bounds on |lambda_k - k-th eigenvalue|, from the bounds rho of the single residuals. low, high: no other eigenvalue lies between them.
std::vector<double> calc_bounds(std::span<const double> lambda, const std::vector<double>& rho, double low, double high) {
  const std::size_t count = lambda.size();
  std::vector<double> bound(count), next(count + 1, high);  // next[i]: lower bound of modes i, i + 1, ... and all above
  for (std::size_t i = count; i-- > 0;) next[i] = std::min(next[i + 1], lambda[i] - rho[i]);
  double below = low;
  for (std::size_t first = 0, last; first < count; first = last) {
    double reach = lambda[first] + rho[first], squares = 0;
    for (last = first; last < count && (last == first || next[last] <= reach); ++last) {
      reach = std::max(reach, lambda[last] + rho[last]);
      squares += rho[last] * rho[last];
    }
    const double gap = std::min(lambda[first] - below, next[last] - lambda[last - 1]), linear = std::sqrt(squares);
    for (std::size_t i = first; i < last; ++i) bound[i] = gap > linear ? squares / gap : linear;
    below = reach;
  }
  return bound;
}

}  // namespace

MassBounds find_mass_bounds(const comm::Communicator& comm, const mesh::LocalMesh& local, job::Mass mass_kind) {
  if (mass_kind == job::Mass::lumped) return {};
  if (local.order == 1) return {0.5, 2.5};
  std::array<Vec3, 10> x{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
  for (int e = 0; e < 6; ++e)
    for (int k = 0; k < 3; ++k) x[4 + e][k] = (x[mesh::kEdges[e][0]][k] + x[mesh::kEdges[e][1]][k]) / 2;
  const MassBounds straight = find_element_bounds(x);
  std::array<double, 2> worst{straight.max, 1.0 / straight.min};
  for (std::int32_t e = 0; e < local.tet_count(); ++e) {
    for (int i = 0; i < 10; ++i) x[i] = local.nodes_m[local.tets[10 * e + i]];
    const auto [min, max] = enclose_jacobian(x);
    if (max < (1 + 1e-9) * min) continue;
    const MassBounds bounds = min > 0.5 * max ? MassBounds{straight.min * min / max, straight.max * max / min} : find_element_bounds(x);
    worst = {std::max(worst[0], bounds.max), std::max(worst[1], 1.0 / bounds.min)};
  }
  comm.max(worst);
  return {1.0 / worst[1], worst[0]};
}

std::vector<double> calc_algebraic_cents(const comm::Communicator& comm, Mat stiffness, Mat mass, const MassBounds& bounds,
                                         const Solution& solution) {
  const std::size_t count = solution.lambda.size();
  petsc::VecHandle diagonal;
  petsc::check(MatCreateVecs(mass, diagonal.out(), nullptr));
  petsc::check(MatGetDiagonal(mass, diagonal));
  PetscReal min = 0, max = 0;
  petsc::check(VecMin(diagonal, nullptr, &min));
  petsc::check(VecMax(diagonal, nullptr, &max));
  petsc::check(MatGetDiagonal(stiffness, diagonal));

  std::vector<double> scale(count, 0.0);  // phi^T diag(K) phi
  const PetscScalar *k = nullptr, *phi = nullptr;
  PetscInt rows = 0, stride = 0;
  petsc::check(VecGetLocalSize(diagonal, &rows));
  petsc::check(VecGetArrayRead(diagonal, &k));
  petsc::check(MatDenseGetLDA(solution.shapes, &stride));
  petsc::check(MatDenseGetArrayRead(solution.shapes, &phi));
  for (std::size_t m = 0; m < count; ++m)
    for (PetscInt i = 0; i < rows; ++i) {
      const double u = phi[static_cast<std::size_t>(stride) * m + static_cast<std::size_t>(i)];
      scale[m] += k[i] * u * u;
    }
  petsc::check(MatDenseRestoreArrayRead(solution.shapes, &phi));
  petsc::check(VecRestoreArrayRead(diagonal, &k));
  comm.sum(scale);

  // |r|_{M^-1} / lambda <= residual * amplification
  const double amplification = std::sqrt(bounds.max * max / (bounds.min * min));
  std::vector<double> rho(count);
  for (std::size_t m = 0; m < count; ++m) rho[m] = solution.residual[m] * amplification * solution.lambda[m];
  constexpr double kTwoPi = 2 * std::numbers::pi;
  const auto square = [](double x) { return x * x; };
  const double low = solution.low_hz > 0 ? square(kTwoPi * solution.low_hz) : 0.0, high = square(kTwoPi * solution.high_hz);
  const std::vector<double> bound = calc_bounds(solution.lambda, rho, low, high);

  constexpr double kRoundings = 8.0;  // relative error of an entry of K in eps: a sum over several elements of products of four numbers
  std::vector<double> cents(count);
  for (std::size_t m = 0; m < count; ++m) {
    const double rounding = kRoundings * std::numeric_limits<double>::epsilon() * scale[m];
    cents[m] = to_cents(solution.lambda[m], bound[m] + rounding);
  }
  return cents;
}

}  // namespace carillon::error_bars
