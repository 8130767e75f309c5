// Checks of a bank's nonlinear energy.
// Method: elastic energy is non-negative. sum over r of (l_r + eta_r)^2 / 2 is; the total is, too, if the squares of l_r do not exceed the
//   linear energy: 1 - L^-1/2 B^T B L^-1/2 positive semi-definite (L: eigenvalues, B: array `linear`), tested by Cholesky. The gradient is
//   compared with finite differences of V along a random direction at a random point: polynomials that agree there are identical (Schwartz
//   and Zippel). All coupled modes move with equal energy, scaled so that V is about 1 J; V is evaluated six times for any number of modes.
// Source: docs/equations.md E12.
#include <cmath>
#include <random>
#include <vector>

#include "runtime/bank/faults.hpp"

namespace carillon::bank {
namespace {

constexpr double kSlack = 1e-6;              // relative to 1: round-off between stored B and eigenvalues
constexpr double kGradientTolerance = 1e-6;  // relative to the terms of V; the differences are exact up to rounding
constexpr double kMaxThicknessM = 1e7, kMaxRatio = 1e6;

/// True if (1 + kSlack) 1 - W is positive definite. w: (n, n), overwritten.
bool is_below_one(std::vector<double>& w, std::size_t n) {
  for (double& value : w) value = -value;
  for (std::size_t i = 0; i < n; ++i) w[i * n + i] += 1.0 + kSlack;
  for (std::size_t j = 0; j < n; ++j) {
    double pivot = w[j * n + j];
    for (std::size_t k = 0; k < j; ++k) pivot -= w[j * n + k] * w[j * n + k];
    if (!(pivot > 0.0) || !std::isfinite(pivot)) return false;
    const double root = w[j * n + j] = std::sqrt(pivot);
    for (std::size_t i = j + 1; i < n; ++i) {
      double sum = w[i * n + j];
      for (std::size_t k = 0; k < j; ++k) sum -= w[i * n + k] * w[j * n + k];
      w[i * n + j] = sum / root;
    }
  }
  return true;
}

bool is_part_of_linear(const Bank& bank) {
  const QuarticEnergy& energy = bank.quartic;
  const std::size_t n = energy.mode_count(), rows = energy.row_count();
  std::vector<double> w(n * n), row(n);
  for (std::size_t r = 0; r < rows; ++r) {
    for (std::size_t i = 0; i < n; ++i) row[i] = energy.linear[r * n + i] / std::sqrt(bank.eigenvalue_rad2_s2[energy.modes[i]]);
    for (std::size_t i = 0; i < n; ++i)
      for (std::size_t j = 0; j <= i; ++j) w[i * n + j] += row[i] * row[j];
  }
  return is_below_one(w, n);
}

/// Directional derivative by the gradient minus that by differences of V, relative to the summed magnitudes; infinite if not finite, 0
/// within rounding.
double calc_gradient_error(const Bank& bank) {
  const QuarticEnergy& energy = bank.quartic;
  const std::size_t n = energy.mode_count();
  std::vector<double> q(n), way(n), there(n), gradient(n), none(n);
  std::mt19937 chance(7);
  const auto draw = [&] { return (static_cast<double>(chance() % 2001) / 1000.0 - 1.0); };
  for (std::size_t i = 0; i < n; ++i) {
    const double size = 1.0 / std::sqrt(bank.eigenvalue_rad2_s2[energy.modes[i]]);
    q[i] = size * draw();
    way[i] = size * draw();
  }
  // The energy spans many orders of magnitude (hair to bridge) and may be negative for a curved body.
  const double energy_j = std::abs(calc_energy_j(energy, q, none));
  if (!std::isfinite(energy_j)) return HUGE_VAL;
  const double share = energy_j > 0.0 ? std::pow(energy_j, -0.25) : 1.0;
  for (auto* list : {&q, &way})
    for (double& x : *list) x *= share;
  (void)calc_energy_j(energy, q, gradient);
  double along = 0.0, difference = 0.0, scale = 0.0;
  for (std::size_t i = 0; i < n; ++i) along += gradient[i] * way[i];
  for (std::size_t i = 0; i < n; ++i) scale += std::abs(gradient[i] * way[i]);
  // Exact for quartic polynomials.
  for (const auto& [step, weight] : {std::pair(1.0, 8.0 / 12.0), {-1.0, -8.0 / 12.0}, {2.0, -1.0 / 12.0}, {-2.0, 1.0 / 12.0}}) {
    for (std::size_t i = 0; i < n; ++i) there[i] = q[i] + step * way[i];
    const double there_j = calc_energy_j(energy, there, none);
    difference += weight * there_j;
    scale += std::abs(weight * there_j);
  }
  if (!std::isfinite(along) || !std::isfinite(difference)) return HUGE_VAL;
  return std::abs(along - difference) <= kGradientTolerance * scale ? 0.0 : std::abs(along - difference) / scale;
}

}  // namespace

Check check_quartic(const Bank& bank) {
  const QuarticEnergy& energy = bank.quartic;
  if (energy.is_empty()) return {"nonlinear", "no nonlinear energy", {}};
  Faults faults;
  const auto look = [&](const char* name, const auto& values) {
    for (std::size_t i = 0; i < values.size(); ++i)
      if (!std::isfinite(values[i])) faults.add("nonlinear/{}[{}] is {}, not a finite number", name, i, static_cast<double>(values[i]));
  };
  look("A", energy.rows);
  look("G", energy.gradient);
  look("stress", energy.stress);
  look("linear", energy.linear);
  for (std::size_t p = 0; p < energy.point_count(); ++p)
    if (!(energy.weight[p] >= 0.0) || !std::isfinite(energy.weight[p]))
      faults.add("nonlinear/weight[{}] is {:.6g}, and weights are not negative", p, energy.weight[p]);
  if (!(energy.rest_energy_j >= 0.0) || !std::isfinite(energy.rest_energy_j))
    faults.add("nonlinear/rest_energy_j is {:.6g} J, not an energy", energy.rest_energy_j);
  if (!(energy.error >= 0.0) || !std::isfinite(energy.error)) faults.add("nonlinear/error is {:.6g}, not an error", energy.error);
  if (!(energy.membrane_ratio >= 0.0 && energy.membrane_ratio <= kMaxRatio))
    faults.add("nonlinear/membrane_ratio is {:.6g}, not a ratio of frequencies", energy.membrane_ratio);
  if (!(energy.thickness_m >= 0.0 && energy.thickness_m <= kMaxThicknessM))
    faults.add("nonlinear/thickness_m is {:.6g} m, not a thickness", energy.thickness_m);
  for (const std::int32_t mode : energy.modes)
    if (!(bank.eigenvalue_rad2_s2[mode] > 0.0)) return {"nonlinear", "", faults.take()};  // reported elsewhere
  if (!faults.empty()) return {"nonlinear", "", faults.take()};
  // In air (after choose_frequencies) the linear energy includes the air.
  if (!energy.linear.empty() && !bank.multipoles.is_in_decay && !is_part_of_linear(bank))
    faults.add("nonlinear/linear holds more than the linear energy of the modes, so that the energy could be negative");
  if (const double error = calc_gradient_error(bank); error > 0.0)
    faults.add("the gradient of the nonlinear energy differs from finite differences by {:.2g}", error);
  return {"nonlinear",
          fmt::format("{} coupled modes, {} {}{}, {}", energy.mode_count(), energy.row_count(), energy.row_count() == 1 ? "row" : "rows",
                      energy.is_of_points() ? fmt::format(" at {} points", energy.point_count()) : "",
                      energy.linear.empty() ? "flat" : "curved"),
          faults.take()};
}

}  // namespace carillon::bank
