// Eigenproblem of modes coupled by the mass matrix of the air.
#include "precompute/air/coupling.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <random>
#include <vector>

#include "runtime/base/error.hpp"

namespace carillon::air {
namespace {

/// Scaled B B^T / n of random numbers: symmetric positive.
std::vector<double> make_mass(std::size_t n, double size, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  std::vector<double> root(n * n), mass(n * n);
  for (double& x : root) x = normal(random);
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = 0; j < n; ++j)
      for (std::size_t k = 0; k < n; ++k) mass[i * n + j] += size / static_cast<double>(n) * root[i * n + k] * root[j * n + k];
  return mass;
}

std::vector<double> spread(const Mixture& mixture, std::size_t n) {
  std::vector<double> parts(n);
  for (std::size_t i = 0; i < mixture.motions.size(); ++i) parts[mixture.motions[i]] = mixture.parts[i];
  return parts;
}

/// a^T (1 + M) b
double calc_product(const std::vector<double>& a, const std::vector<double>& b, const std::vector<double>& mass) {
  double sum = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i)
    for (std::size_t j = 0; j < a.size(); ++j) sum += a[i] * b[j] * (mass[i * a.size() + j] + (i == j ? 1.0 : 0.0));
  return sum;
}

std::vector<double> make_wave_numbers(std::size_t n) {
  std::vector<double> waves;
  for (std::size_t i = 0; i < n; ++i) waves.push_back(1.0 + 0.07 * static_cast<double>((5 * i) % n));  // unordered
  return waves;
}

TEST(couple_modes, solves_the_eigenproblem) {
  constexpr std::size_t n = 12;
  const std::vector<double> waves = make_wave_numbers(n), mass = make_mass(n, 0.5, 3);
  const std::vector<Mixture> mixtures = couple_modes(waves, mass, 0.0);
  ASSERT_EQ(mixtures.size(), n);
  for (std::size_t a = 0; a < n; ++a) {
    const std::vector<double> q = spread(mixtures[a], n);
    const double lambda = mixtures[a].wave_number_1_m * mixtures[a].wave_number_1_m;
    double own = 0.0;
    for (std::size_t i = 0; i < n; ++i) {
      double right = q[i];
      for (std::size_t j = 0; j < n; ++j) right += mass[i * n + j] * q[j];
      EXPECT_NEAR(waves[i] * waves[i] * q[i], lambda * right, 1e-12);
      own += q[i] * q[i];
    }
    EXPECT_NEAR((1.0 + mixtures[a].added_mass) * own, 1.0, 1e-12);
    for (std::size_t b = 0; b < n; ++b) EXPECT_NEAR(calc_product(q, spread(mixtures[b], n), mass), a == b ? 1.0 : 0.0, 1e-12);
  }
}

TEST(couple_modes, leaves_each_mode_its_number_where_the_air_is_light) {
  constexpr std::size_t n = 9;
  const std::vector<double> waves = make_wave_numbers(n), mass = make_mass(n, 1e-3, 4);
  const std::vector<Mixture> mixtures = couple_modes(waves, mass, 1e-3);
  for (std::size_t m = 0; m < n; ++m) {
    const std::vector<double> q = spread(mixtures[m], n);
    EXPECT_NEAR(q[m], 1.0, 1e-3);
    EXPECT_NEAR(mixtures[m].wave_number_1_m * std::sqrt(1.0 + mass[m * n + m]) / waves[m], 1.0, 1e-5);
    // Perturbation: k_m^2 M_im / (k_i^2 - k_m^2), with an error of second order in M.
    for (std::size_t i = 0; i < n; ++i)
      if (i != m && q[i] != 0.0) {
        EXPECT_NEAR(q[i], waves[m] * waves[m] * mass[i * n + m] / (waves[i] * waves[i] - waves[m] * waves[m]), 1e-4);
      }
  }
}

TEST(couple_modes, keeps_what_is_large_enough) {
  constexpr std::size_t n = 20;
  const std::vector<double> waves = make_wave_numbers(n), mass = make_mass(n, 0.1, 5);
  const std::vector<Mixture> all = couple_modes(waves, mass, 0.0), some = couple_modes(waves, mass, 0.05);
  for (std::size_t m = 0; m < n; ++m) {
    ASSERT_EQ(all[m].motions.size(), n);
    EXPECT_LT(some[m].motions.size(), n);
    const std::vector<double> whole = spread(all[m], n), kept = spread(some[m], n);
    double largest = 0.0;
    for (const double x : whole) largest = std::max(largest, std::abs(x));
    for (std::size_t i = 0; i < n; ++i) EXPECT_EQ(kept[i], i == m || std::abs(whole[i]) >= 0.05 * largest ? whole[i] : 0.0);
  }
}

TEST(couple_modes, refuses_a_mass_that_is_none) {
  EXPECT_THROW(couple_modes(std::vector{1.0, 2.0}, std::vector{-1.5, 0.0, 0.0, 0.1}, 1e-3), InputError);
  EXPECT_THROW(couple_modes(std::vector{1.0, 2.0}, std::vector{0.1, 2.0, 2.0, 0.1}, 1e-3), InputError);
}

TEST(follow_mode, finds_the_mode_that_was_near) {
  constexpr std::size_t n = 8;
  const std::vector<double> waves = make_wave_numbers(n), before = make_mass(n, 0.4, 6);
  std::vector<double> after = before;
  for (double& x : after) x *= 1.02;
  const std::vector<Mixture> old = couple_modes(waves, before, 0.0), wanted = couple_modes(waves, after, 0.0);
  for (std::size_t m = 0; m < n; ++m) {
    const Mixture found = follow_mode(waves, after, old[m]);
    EXPECT_NEAR(found.wave_number_1_m, wanted[m].wave_number_1_m, 1e-9);
    EXPECT_NEAR(found.added_mass, wanted[m].added_mass, 1e-9);
    for (std::size_t i = 0; i < n; ++i) EXPECT_NEAR(found.parts[i], wanted[m].parts[i], 1e-9);
  }
}

TEST(follow_mode, keeps_two_modes_of_one_frequency_apart) {
  // Like a square plate: any rotation of the pair is valid, and both must stay a basis despite rounding.
  const std::vector<double> waves{1.0, 1.0, 1.3};
  const std::vector<double> mass{0.3, 0.0, 0.0, 0.0, 0.3, 0.0, 0.0, 0.0, 0.1};
  std::vector<double> noisy = mass;
  noisy[1] = noisy[3] = 3e-7;
  const double c = std::cos(0.4), s = std::sin(0.4), scale = 1.0 / std::sqrt(1.3);
  const Mixture one{.motions = {0, 1, 2}, .parts = {scale * c, scale * s, 0.0}, .wave_number_1_m = 0.87, .added_mass = 0.3};
  const Mixture two{.motions = {0, 1, 2}, .parts = {-scale * s, scale * c, 0.0}, .wave_number_1_m = 0.87, .added_mass = 0.3};
  const Mixture a = follow_mode(waves, noisy, one), b = follow_mode(waves, noisy, two);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_NEAR(a.parts[i], one.parts[i], 1e-6);
    EXPECT_NEAR(b.parts[i], two.parts[i], 1e-6);
  }
  EXPECT_NEAR(calc_product(a.parts, b.parts, noisy), 0.0, 1e-6);
}

TEST(follow_mode, lets_a_rigid_motion_yield) {
  // lambda = 0 of the second: its part is - M_01 / (1 + M_11), which reduces the mass of the first.
  const std::vector<double> waves{2.0, 0.0}, mass{0.5, 0.3, 0.3, 0.6};
  const Mixture found = follow_mode(waves, mass, {.motions = {0, 6}, .parts = {1.0, 0.0}, .wave_number_1_m = 1.6, .added_mass = 0.5});
  EXPECT_NEAR(found.parts[1] / found.parts[0], -0.3 / 1.6, 1e-12);
  EXPECT_NEAR(found.wave_number_1_m, 2.0 / std::sqrt(1.5 - 0.09 / 1.6), 1e-12);
}

}  // namespace
}  // namespace carillon::air
