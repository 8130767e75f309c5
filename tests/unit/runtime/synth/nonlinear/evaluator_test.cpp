// Evaluator against sums in double precision, in every form.
#include "runtime/synth/nonlinear/evaluator.hpp"

#include <gtest/gtest.h>

#include <random>

#include "runtime/base/instructions.hpp"

namespace carillon::nonlinear {
namespace {

struct Chance {
  std::mt19937 engine{5};
  double draw() { return std::uniform_real_distribution<double>(-1.0, 1.0)(engine); }
};

bank::QuarticEnergy make_rows(std::size_t n, std::size_t rows, bool is_diagonal, bool is_curved, double size) {
  Chance chance;
  bank::QuarticEnergy energy;
  for (std::size_t i = 0; i < n; ++i) energy.modes.push_back(static_cast<std::int32_t>(i));
  for (std::size_t r = 0; r < rows; ++r)
    for (std::size_t j = 0; j < n; ++j)
      for (std::size_t i = 0; i <= j; ++i) energy.rows.push_back(is_diagonal && i != j ? 0.0F : static_cast<float>(size * chance.draw()));
  for (std::size_t i = 0; i < rows * n && is_curved; ++i) energy.linear.push_back(std::sqrt(size) * chance.draw());
  return energy;
}

/// Four entries per pair in random rows, and two diagonal rows.
bank::QuarticEnergy make_entries(std::size_t n, std::size_t rows, bool is_curved) {
  Chance chance;
  bank::QuarticEnergy energy = make_rows(n, rows, true, is_curved, 1e6);
  const std::size_t pairs = bank::count_pairs(n);
  std::fill(energy.rows.begin() + static_cast<std::ptrdiff_t>(2 * pairs), energy.rows.end(), 0.0F);
  for (std::size_t pair = 0; pair < pairs; ++pair)
    for (int e = 0; e < 4; ++e) energy.rows[chance.engine() % rows * pairs + pair] = static_cast<float>(1e6 * chance.draw());
  return energy;
}

bank::QuarticEnergy make_points(std::size_t n, std::size_t rows, std::size_t points, std::size_t parts, bool is_curved) {
  Chance chance;
  bank::QuarticEnergy energy;
  for (std::size_t i = 0; i < n; ++i) energy.modes.push_back(static_cast<std::int32_t>(i));
  for (std::size_t i = 0; i < points * parts * n; ++i) energy.gradient.push_back(static_cast<float>(30.0 * chance.draw()));
  for (std::size_t i = 0; i < rows * points * (parts == 6 ? 3 : 6); ++i) energy.stress.push_back(static_cast<float>(1e4 * chance.draw()));
  for (std::size_t p = 0; p < points; ++p) energy.weight.push_back(p % 5 == 2 ? 0.0 : 1.0 + chance.draw());
  for (std::size_t i = 0; i < rows * n && is_curved; ++i) energy.linear.push_back(1e3 * chance.draw());
  return energy;
}

void expect_same(const bank::QuarticEnergy& energy, const CoupledKernels& kernels, double tolerance) {
  const std::size_t n = energy.mode_count();
  Evaluator evaluator(energy, kernels);
  Chance chance;
  for (const int count : {static_cast<int>(n), static_cast<int>(n) - 1, 1}) {
    evaluator.set_count(count);
    std::vector<double> q(n), unit(n + 64, evaluator.get_scale()), gradient(n), found(n + 64), exact(n + 64);
    std::vector<float> scaled(n + 64, 0.0F);
    for (std::size_t i = 0; i < static_cast<std::size_t>(count); ++i) {
      exact[i] = q[i] = 3.0 * chance.draw() / evaluator.get_scale();
      scaled[i] = static_cast<float>(q[i] * evaluator.get_scale());
    }
    const double wanted = bank::calc_energy_j(energy, q, gradient);
    const double energy_j = evaluator.evaluate(scaled.data(), exact.data(), unit.data(), found.data());
    double largest = 0.0;
    for (std::size_t i = 0; i < static_cast<std::size_t>(count); ++i) largest = std::max(largest, std::abs(gradient[i]));
    EXPECT_NEAR(energy_j, wanted, tolerance * (std::abs(wanted) + largest / evaluator.get_scale())) << n << " modes, " << count;
    for (std::size_t i = 0; i < n; ++i)
      EXPECT_NEAR(found[i], i < static_cast<std::size_t>(count) ? gradient[i] : 0.0, tolerance * largest) << n << " modes, " << i;
  }
}

TEST(Evaluator, IsTheSumsInDoublePrecisionInEveryFormAndInstructionSet) {
  for (const base::Instructions set : base::list_instructions()) {
    const CoupledKernels& kernels = get_kernels(set);
    for (const bool is_curved : {false, true}) {
      for (const std::size_t n : {2u, 7u, 8u, 9u, 16u, 17u, 30u, 51u})
        for (const std::size_t rows : {1u, 3u, 40u}) {
          expect_same(make_rows(n, rows, false, is_curved, 1e6), kernels, 2e-5);
          expect_same(make_rows(n, rows, true, is_curved, 1e-3), kernels, 1e-13);
        }
      for (const std::size_t n : {2u, 9u, 30u, 51u}) {
        const bank::QuarticEnergy energy = make_entries(n, n < 30 ? 33 : 150, is_curved);
        expect_same(energy, kernels, 2e-5);
        if (n > 9) {
          EXPECT_LT(Evaluator(energy, kernels).calc_bytes(), energy.rows.size() * sizeof(float) / 2) << "kept by entries";
        }
      }
      for (const std::size_t parts : {6u, 9u})
        for (const std::size_t n : {2u, 5u, 30u}) expect_same(make_points(n, 9, 23, parts, is_curved), kernels, 1e-5);
    }
  }
}

}  // namespace
}  // namespace carillon::nonlinear
