// Vibrating spheres and their closed form.
// With dp/dn = Y_lm on a sphere of radius 1: p = h_l(kr) / (k h_l'(k)) Y_lm. P. Morse, K. Ingard, Theoretical Acoustics (1968), 7.2.
#pragma once

#include <cmath>
#include <complex>
#include <cstddef>
#include <map>
#include <utility>
#include <vector>

#include "precompute/air/equations.hpp"
#include "precompute/air/expansion.hpp"
#include "tests/unit/precompute/air/bodies.hpp"
#include "tests/unit/precompute/air/fields.hpp"
#include "tests/unit/precompute/air/sources.hpp"

namespace carillon::air::testing {

using Harmonic = std::pair<int, int>;  // l, m

/// Far-field pressure over Y_lm: e^{ikr} / (i^{l+1} kr) times this.
inline Complex find_exact(int l, double k) { return 1.0 / (k * calc_hankel_slope(l, k)); }

/// Power over rho c / 2 times the integral of the squared velocity, which is 1: Re(i h_l / h_l') = 1 / |k h_l'|^2 by the Wronskian.
inline double find_exact_efficiency(int l, double k) { return std::norm(find_exact(l, k)); }

/// A sphere of radius 1 that vibrates in several harmonics, solved at each wave number. Invariant: all harmonics are right-hand sides of
/// one solve, with the least-squares linear function on each facet.
class Spheres {
 public:
  /// 10 n^2 + 2 nodes.
  Spheres(int n, std::vector<Harmonic> harmonics)
      : harmonics_(std::move(harmonics)),
        surface_(make_ball(n, 1.0).make_surface()),
        equations_(surface_, find_enclosing_sphere(surface_.get_nodes()), make_velocity(), harmonics_.size()) {}

  const std::vector<Harmonic>& get_harmonics() const { return harmonics_; }
  const RadiatingSurface& get_surface() const { return surface_; }
  const Outcome& solve(double k) {
    const auto [found, is_new] = outcomes_.try_emplace(k);
    if (is_new) found->second = testing::solve(equations_, k);
    return found->second;
  }

  /// rms error over directions at distance r, or in the far field (r = 0), in dB of the field.
  double find_error_db(std::size_t side, double k, double r) {
    const Outcome& outcome = solve(k);
    const auto [l, m] = harmonics_[side];
    const auto found = outcome.get_coefficients(side);
    const auto weigh = [&](int order) { return r > 0.0 ? std::abs(calc_hankel(order, k * r)) : 1.0; };
    double error = 0.0;
    for (int order = 0; order <= outcome.order; ++order)
      for (int n = -order; n <= order; ++n) {
        const Complex wanted = order == l && n == m ? find_exact(l, k) : Complex();
        const double size = weigh(order) * std::abs(found[order * order + order + n] - wanted);
        error += size * size;
      }
    return to_db(std::sqrt(error) / (weigh(l) * std::abs(find_exact(l, k))));
  }

  /// Radiated power of all coefficients over the closed form.
  double find_power_ratio(std::size_t side, double k) {
    double efficiency = 0.0;
    for (const Complex& c : solve(k).get_coefficients(side)) efficiency += std::norm(c);
    return efficiency / find_exact_efficiency(harmonics_[side].first, k);
  }

  /// Far-field amplitude over that of order 0 for the same velocity.
  double find_share(std::size_t side, double k) const {
    return std::abs(find_exact(harmonics_[side].first, k)) / std::abs(find_exact(0, k));
  }

 private:
  std::vector<float> make_velocity() const {
    const std::vector<float> pairs = project(surface_, harmonics_.size(), [&](const Vec3& place, const Vec3&, std::size_t i) {
      return Complex(calc_harmonic(harmonics_[i].first, harmonics_[i].second, normalise(place)));
    });
    std::vector<float> velocity;
    for (std::size_t i = 0; i < pairs.size(); i += 2) velocity.push_back(pairs[i]);  // imaginary parts are 0
    return velocity;
  }

  std::vector<Harmonic> harmonics_;
  RadiatingSurface surface_;
  BoundaryEquations equations_;
  std::map<double, Outcome> outcomes_;
};

}  // namespace carillon::air::testing
