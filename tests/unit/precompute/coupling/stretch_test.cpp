// Mean stretch of held bodies in few rows: hardening of thin beams in closed form, and a lower bound of the full fields.
#include <gtest/gtest.h>

#include <cmath>

#include "runtime/base/error.hpp"
#include "tests/support/box_mesh.hpp"
#include "tests/unit/precompute/coupling/bodies.hpp"

namespace carillon::coupling {
namespace {

using tests::make_box;
using tests::make_solid;
using tests::ModalBody;
using tests::solve_body;

constexpr double kLength = 0.2, kWidth = 0.008, kThickness = 0.004;

ModalBody make_bar(bool holds_both_ends) {
  const auto held = [&](const Vec3& x) { return x[0] < 1e-9 || (holds_both_ends && x[0] > kLength - 1e-9); };
  return solve_body(PETSC_COMM_WORLD, make_box({24, 1, 1}, {kLength, kWidth, kThickness}, 2), held, make_solid(70e9, 0.0, 2700), 6);
}

Condensed condense(const ModalBody& body, int modes, bool is_stretch) {
  return condense_modes(body.comm, body.solved(), {.is_stretch = is_stretch, .modes = modes, .below_hz = 1e6});
}

TEST(Stretch, of_a_clamped_beam_is_one_row_that_hardens_as_the_thin_beam) {
  const ModalBody body = make_bar(true);
  const Condensed stretch = condense(body, 4, true), full = condense(body, 4, false);
  EXPECT_NEAR(tests::calc_gamma(body, stretch.energy, 0, kThickness) / 0.719293030305, 1, 0.02);
  if (!body.comm.is_root()) return;
  EXPECT_EQ(stretch.energy.row_count(), 1u);
  EXPECT_EQ(stretch.energy.modes, full.energy.modes);
  // Both planes are included, and no motion exceeds the energy of all fields.
  const std::size_t n = stretch.energy.mode_count();
  std::vector<double> gradient(n);
  for (std::size_t i = 0; i < n; ++i) {
    std::vector<double> q(n);
    q[i] = 1e-3;
    const double few = bank::calc_energy_j(stretch.energy, q, gradient), all = bank::calc_energy_j(full.energy, q, gradient);
    EXPECT_GT(few, 0.7 * all) << i;
    EXPECT_LT(few, 1.01 * all) << i;
  }
}

TEST(Stretch, is_refused_where_no_stress_has_a_mean) {
  EXPECT_THROW((void)condense(make_bar(false), 4, true), InputError);
  const ModalBody loose =
      solve_body(PETSC_COMM_WORLD, make_box({12, 8, 1}, {kLength, 0.13, 0.001}, 2), {}, make_solid(200e9, 0.3, 7800), 12);
  EXPECT_THROW((void)condense(loose, 6, true), InputError);
}

TEST(Stretch, of_a_sheet_held_along_its_rim_has_most_of_what_hardens) {
  const double side = 0.2;
  const auto on_edge = [&](double x) { return x < 1e-9 || x > side - 1e-9; };
  const auto held = [&](const Vec3& x) { return on_edge(x[0]) || on_edge(x[1]); };
  const ModalBody body = solve_body(PETSC_COMM_WORLD, make_box({10, 10, 1}, {side, side, 0.002}, 2), held, make_solid(200e9, 0.3, 7800), 6);
  const double few = tests::calc_gamma(body, condense(body, 3, true).energy, 0, 0.002);
  const double all = tests::calc_gamma(body, condense(body, 3, false).energy, 0, 0.002);
  EXPECT_GT(few / all, 0.6);
  EXPECT_LT(few / all, 1.001);
}

}  // namespace
}  // namespace carillon::coupling
