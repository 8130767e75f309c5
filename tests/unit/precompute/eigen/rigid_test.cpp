#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

#include "precompute/eigen/rigid_modes.hpp"
#include "precompute/petsc/session.hpp"
#include "runtime/base/error.hpp"
#include "tests/unit/precompute/eigen/spring_network.hpp"

namespace carillon::eigen {
namespace {

// Checks that rigid modes are M-orthonormal and free of force; returns their number.
std::size_t count_and_check(const test::System& system) {
  std::vector<std::int64_t> per_component;
  const auto modes = make_rigid_modes({system.stiffness, system.mass}, system.problem.nodes, per_component);
  EXPECT_EQ(std::accumulate(per_component.begin(), per_component.end(), std::int64_t{0}), static_cast<std::int64_t>(modes.size()));
  EXPECT_EQ(per_component.size(), static_cast<std::size_t>(system.problem.nodes.component_count));
  petsc::VecHandle force;
  check(MatCreateVecs(system.stiffness, force.out(), nullptr));
  for (std::size_t i = 0; i < modes.size(); ++i) {
    check(MatMult(system.stiffness, modes[i], force));
    PetscReal norm = 0;
    check(VecNorm(force, NORM_INFINITY, &norm));
    EXPECT_LT(norm, 1e-8) << "of stiffness entries of 1e6";
    for (std::size_t j = 0; j <= i; ++j) {
      PetscScalar dot = 0;
      check(MatMult(system.mass, modes[i], force));
      check(VecDot(force, modes[j], &dot));
      EXPECT_NEAR(dot, i == j ? 1.0 : 0.0, 1e-13) << i << " " << j;
    }
  }
  return modes.size();
}

TEST(RigidModes, number_six_for_a_free_body_far_from_the_origin) {
  EXPECT_EQ(count_and_check(test::make_system(make_block(3, 3, 4, {1000, -500, 20}))), 6u);
}

TEST(RigidModes, number_three_for_a_body_fixed_at_a_point) {
  Network network = make_block(3, 3, 4);
  network.fixed = {13};
  EXPECT_EQ(count_and_check(test::make_system(network)), 3u);
}

TEST(RigidModes, number_one_for_a_body_fixed_on_a_line) {
  Network network = make_block(3, 3, 4);
  network.fixed = {0, 35};
  EXPECT_EQ(count_and_check(test::make_system(network)), 1u);
  network.fixed = {0, 9, 18, 27};
  EXPECT_EQ(count_and_check(test::make_system(network)), 1u);
}

TEST(RigidModes, vanish_for_a_body_fixed_at_three_points) {
  Network network = make_block(3, 3, 4);
  network.fixed = {0, 2, 35};
  EXPECT_EQ(count_and_check(test::make_system(network)), 0u);
}

TEST(RigidModes, are_found_per_component) {
  Network other = make_block(2, 3, 3, {10, 0, 0});
  other.fixed = {4};
  EXPECT_EQ(count_and_check(test::make_system(test::join(make_block(3, 3, 3), other))), 9u);
  EXPECT_EQ(count_and_check(test::make_system(test::join(make_block(3, 3, 3), make_block(2, 2, 3, {10, 0, 0})))), 12u);
}

TEST(RigidModes, lack_the_spin_of_a_body_whose_nodes_lie_on_a_line) {
  Network network;
  for (int i = 0; i < 4; ++i) {
    network.nodes.push_back({0.3 * i, 0.4 * i, 1.2 * i});
    network.mass_kg.push_back(1);
    network.component.push_back(0);
    if (i > 0) network.springs.push_back({i - 1, i, 1e6, false});
  }
  EXPECT_EQ(count_and_check(test::make_system(network)), 5u);
}

TEST(RigidModes, refuse_a_layout_that_forgets_the_fixed_nodes) {
  Network network = make_block(3, 3, 4);
  network.fixed = {0, 2, 35};
  test::System system = test::make_system(network);
  system.problem.nodes.fixed.clear();
  std::vector<std::int64_t> per_component;
  EXPECT_THROW(make_rigid_modes({system.stiffness, system.mass}, system.problem.nodes, per_component), SolveError);
}

TEST(RigidModes, survive_a_wire_ten_thousand_times_longer_than_thick) {
  Network network = make_block(2, 2, 30);
  for (Vec3& x : network.nodes) x = {1e-4 * x[0], 1e-4 * x[1], x[2] / 29};
  EXPECT_EQ(count_and_check(test::make_system(network)), 6u);
}

}  // namespace
}  // namespace carillon::eigen
