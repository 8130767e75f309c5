// Vibrating spheres against the closed form, and expansions against fields that are known.
// With dp/dn = Y_lm on a sphere of radius 1: p = h_l(kr) / (k h_l'(k)) Y_lm. P. Morse, K. Ingard, Theoretical Acoustics (1968), 7.2.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <map>
#include <numbers>
#include <utility>
#include <vector>

#include "precompute/bem/equations.hpp"
#include "precompute/bem/expansion.hpp"
#include "tests/unit/precompute/bem/bodies.hpp"
#include "tests/unit/precompute/bem/fields.hpp"

namespace carillon::bem {
namespace {

using testing::calc_hankel;
using testing::calc_hankel_slope;
using testing::calc_harmonic;
using testing::Complex;
using testing::make_ball;
using testing::Outcome;
using testing::sample_corners;
using testing::to_db;

using Harmonic = std::pair<int, int>;  // l, m

const std::vector<Harmonic>& get_harmonics() {
  static const std::vector<Harmonic> harmonics{{0, 0}, {1, 0}, {1, -1}, {2, 0}, {2, 1}, {3, 0}, {3, 2}};
  return harmonics;
}

/// One sphere of 1,442 nodes for all tests here, solved once at each wave number.
class Spheres {
 public:
  Spheres()
      : surface_(make_ball(12, 1.0).make_surface()),
        equations_(surface_, find_enclosing_sphere(surface_.get_nodes()),
                   sample_corners(surface_, get_harmonics().size(),
                                  [](const Vec3& place, const Vec3&, std::size_t m) {
                                    return calc_harmonic(get_harmonics()[m].first, get_harmonics()[m].second, normalise(place));
                                  }),
                   get_harmonics().size()) {}

  const RadiatingSurface& get_surface() const { return surface_; }
  const Outcome& solve(double k) {
    const auto [found, is_new] = outcomes_.try_emplace(k);
    if (is_new) found->second = testing::solve(equations_, k);
    return found->second;
  }

 private:
  RadiatingSurface surface_;
  BoundaryEquations equations_;
  std::map<double, Outcome> outcomes_;
};

Spheres& get_spheres() {
  static Spheres spheres;
  return spheres;
}

Complex find_exact(int l, double k) { return 1.0 / (k * calc_hankel_slope(l, k)); }

/// rms error over directions at distance r, or far away (r = 0), in dB of the field.
double find_error_db(const Outcome& outcome, std::size_t side, double k, double r) {
  const auto [l, m] = get_harmonics()[side];
  const std::span<const Complex> found = outcome.get_coefficients(side);
  double error = 0.0;
  const auto weigh = [&](int order) { return r > 0.0 ? std::abs(calc_hankel(order, k * r)) : 1.0; };
  for (int order = 0; order <= outcome.order; ++order)
    for (int n = -order; n <= order; ++n) {
      const Complex wanted = order == l && n == m ? find_exact(l, k) : Complex();
      const double size = weigh(order) * std::abs(found[static_cast<std::size_t>(order * order + order + n)] - wanted);
      error += size * size;
    }
  return to_db(std::sqrt(error) / (weigh(l) * std::abs(find_exact(l, k))));
}

constexpr double kFictitious = 4.493409457909064;  // zero of j_1; those of j_0 are multiples of pi

TEST(sphere, sends_out_what_the_closed_form_says) {
  const std::vector<double> limits{-45.0, -45.0, -40.0, -38.0};
  for (const double k : {0.01, 0.1, 1.0, std::numbers::pi, kFictitious, 10.0}) {
    const Outcome& outcome = get_spheres().solve(k);
    EXPECT_TRUE(outcome.gmres.is_converged);
    EXPECT_LE(outcome.gmres.products, 30) << k;
    for (std::size_t side = 0; side < get_harmonics().size(); ++side) {
      const int l = get_harmonics()[side].first;
      const double near = find_error_db(outcome, side, k, 2.0), far = find_error_db(outcome, side, k, 0.0);
      EXPECT_LE(near, limits[static_cast<std::size_t>(l)]) << "k " << k << ", l " << l;
      // Far away, order 0 that single precision leaves is as loud as a mode that radiates 1e-5 of what order 0 would.
      if (std::abs(find_exact(l, k)) > 1e-4 * std::abs(find_exact(0, k))) {
        EXPECT_LE(far, limits[static_cast<std::size_t>(l)]) << "k " << k << ", l " << l;
      }
    }
  }
}

TEST(sphere, is_no_worse_at_fictitious_frequencies_than_near_them) {
  for (const double k : {std::numbers::pi, kFictitious}) {
    const Outcome &at = get_spheres().solve(k), &below = get_spheres().solve(0.96 * k), &above = get_spheres().solve(1.04 * k);
    for (std::size_t side = 0; side < get_harmonics().size(); ++side) {
      const double error = find_error_db(at, side, k, 0.0);
      const double there = std::max(find_error_db(below, side, 0.96 * k, 0.0), find_error_db(above, side, 1.04 * k, 0.0));
      EXPECT_LE(error, there + 1.0) << "k " << k << ", l " << get_harmonics()[side].first;
    }
  }
}

TEST(sphere, radiates_the_power_that_the_closed_form_says) {
  for (const double k : {0.1, 1.0, std::numbers::pi, 10.0}) {
    const Outcome& outcome = get_spheres().solve(k);
    for (std::size_t side = 0; side < get_harmonics().size(); ++side) {
      const int l = get_harmonics()[side].first;
      if (l > 2) continue;
      // Power over rho c / 2 times the integral of the squared velocity, which is 1: Re(i h_l / h_l').
      double efficiency = 0.0;
      for (const Complex& c : outcome.get_coefficients(side)) efficiency += std::norm(c);
      const double wanted = (Complex(0, 1) * calc_hankel(l, k) / calc_hankel_slope(l, k)).real();
      EXPECT_NEAR(efficiency / wanted, 1.0, 0.01) << "k " << k << ", l " << l;
    }
  }
}

TEST(sphere, has_the_pressure_of_the_closed_form_on_its_surface) {
  for (const double k : {0.1, 1.0, kFictitious}) {
    const Outcome& outcome = get_spheres().solve(k);
    const std::size_t count = get_harmonics().size();
    for (std::size_t side = 0; side < count; ++side) {
      const auto [l, m] = get_harmonics()[side];
      const Complex factor = calc_hankel(l, k) * find_exact(l, k);
      double error = 0.0, all = 0.0;
      for (std::size_t i = 0; i < outcome.pressure.size() / count; ++i) {
        const Complex wanted = factor * calc_harmonic(l, m, normalise(get_spheres().get_surface().get_nodes()[i]));
        error += std::norm(Complex(outcome.pressure[i * count + side]) - wanted);
        all += std::norm(wanted);
      }
      EXPECT_LT(std::sqrt(error / all), 0.015) << "k " << k << ", l " << l;
    }
  }
}

TEST(expansion, finds_the_coefficients_of_waves_about_its_centre) {
  // A wave h_l Y_lm on a ball that is not at its centre, pressure and slope given: the integrals must give back 1 for (l, m), else 0.
  const RadiatingSurface surface = make_ball(24, 1.0).make_surface();
  const Sphere sphere{.centre_m = {0.15, -0.1, 0.2}, .radius_m = 1.3};
  const double k = 2.0;
  const std::vector<Harmonic> waves{{0, 0}, {1, 1}, {2, -1}, {3, 3}};
  const auto find = [&](const Vec3& place, const Harmonic& wave) {
    const Vec3 offset = place - sphere.centre_m;
    return calc_hankel(wave.first, k * norm(offset)) * calc_harmonic(wave.first, wave.second, normalise(offset));
  };
  const std::size_t count = waves.size();
  std::vector<std::complex<float>> real_pressure, imaginary_pressure;
  for (const Vec3& node : surface.get_nodes())
    for (const Harmonic& wave : waves) {
      real_pressure.emplace_back(static_cast<float>(find(node, wave).real()), 0.0F);
      imaginary_pressure.emplace_back(static_cast<float>(find(node, wave).imag()), 0.0F);
    }
  const auto make_slopes = [&](bool is_imaginary) {
    return sample_corners(surface, count, [&](const Vec3& place, const Vec3& normal, std::size_t m) {
      const double step = 1e-4;
      const Complex slope = (find(place + step * normal, waves[m]) - find(place - step * normal, waves[m])) / (2.0 * step);
      return is_imaginary ? slope.imag() : slope.real();
    });
  };
  const std::vector<std::int32_t> sides{0, 1, 2, 3};
  const auto of_real = calc_expansion(surface, sphere, k, 6, real_pressure, make_slopes(false), count, sides);
  const auto of_imaginary = calc_expansion(surface, sphere, k, 6, imaginary_pressure, make_slopes(true), count, sides);
  const std::size_t harmonics = count_harmonics(6);
  for (std::size_t side = 0; side < count; ++side) {
    double error = 0.0;
    for (std::size_t i = 0; i < harmonics; ++i) {
      const auto [l, m] = waves[side];
      const Complex found = of_real[side * harmonics + i] + Complex(0, 1) * of_imaginary[side * harmonics + i];
      error = std::max(error, std::abs(found - (i == static_cast<std::size_t>(l * l + l + m) ? 1.0 : 0.0)));
    }
    EXPECT_LT(error, 0.01) << side;
  }
}

TEST(expansion, has_the_functions_of_bessel_and_hankel) {
  for (const double x : {1e-3, 0.1, 1.0, std::numbers::pi, kFictitious, 12.0, 40.0}) {
    const std::vector<double> bessel = calc_bessel(x, 30), logs = calc_log_hankel(x, 30);
    const std::vector<Complex> phases = calc_hankel_phase(x, 30);
    for (int l = 0; l <= 30; ++l) {
      const auto at = static_cast<std::size_t>(l);
      const Complex wanted = calc_hankel(l, x);
      EXPECT_NEAR(bessel[at], wanted.real(), 1e-11 * std::max(std::abs(wanted.real()), x > l ? 1.0 / x : 0.0)) << x << " " << l;
      if (!std::isfinite(wanted.imag())) continue;
      EXPECT_NEAR(logs[at], std::log(std::abs(wanted)), 1e-11 * std::max(1.0, std::abs(logs[at]))) << x << " " << l;
      EXPECT_LT(std::abs(phases[at] - wanted / std::abs(wanted)), 1e-10) << x << " " << l;
    }
  }
  EXPECT_EQ(calc_bessel(0.0, 3), (std::vector{1.0, 0.0, 0.0, 0.0}));
}

}  // namespace
}  // namespace carillon::bem
