// Monopoles and dipoles inside a body as exact exterior fields: no closed form of the body is needed.
#include <gtest/gtest.h>

#include <vector>

#include "precompute/air/equations.hpp"
#include "tests/unit/precompute/air/bodies.hpp"
#include "tests/unit/precompute/air/sources.hpp"

namespace carillon::air {
namespace {

using testing::find_source_errors;
using testing::make_ball;
using testing::make_bell;
using testing::make_bowl;
using testing::make_box;
using testing::Skin;
using testing::Sources;
using testing::spread_wave_numbers;

/// Twelve wave numbers from low to high.
void expect_exact(const char* name, const Skin& skin, const Sources& sources, double low, double high, int most_products) {
  ASSERT_TRUE(testing::is_closed(skin));
  ASSERT_GT(testing::calc_volume(skin), 0.0);
  const RadiatingSurface surface = skin.make_surface();
  for (const testing::SourceErrors& found : find_source_errors(surface, sources, spread_wave_numbers(low, high, 12))) {
    EXPECT_TRUE(found.is_converged) << name << ", k " << found.k;
    EXPECT_GE(found.nodes_per_wave, 6.0) << "the test asks for more than the mesh has";
    EXPECT_LE(found.near_db, -40.0) << name << ", k " << found.k;
    EXPECT_LE(found.far_db, -40.0) << name << ", k " << found.k;
    EXPECT_LE(found.products, most_products) << name << ", k " << found.k;
  }
}

TEST(inside_source, of_a_ball_is_heard_outside) {
  expect_exact("ball", make_ball(9, 1.0), {{{0.2, -0.1, 0.15}, 1.0, {0.2, 0.3, -0.25}}}, 0.01, 7.0, 30);
}

TEST(inside_source, of_a_thin_plate_is_heard_outside) {
  const Skin plate = make_box({0.3, 0.2, 0.01}, {30, 20, 1});
  expect_exact("plate", plate, testing::fill_plate(0.004, {34, 22}, 1.0), 1.0, 80.0, 60);
  expect_exact("plate that bends", plate, testing::fill_plate(0.004, {34, 22}, 0.0), 1.0, 80.0, 60);
}

TEST(inside_source, of_the_wall_of_a_bowl_is_heard_outside_and_inside_the_bowl) {
  expect_exact("bowl", make_bowl(0.15, 0.105), testing::fill_bowl(0.15, 0.075), 0.1, 8.0, 60);
}

TEST(inside_source, of_the_wall_of_a_bell_is_heard_outside) {
  expect_exact("bell", make_bell(0.06), testing::fill_bell(0.04), 0.3, 14.0, 60);
}

}  // namespace
}  // namespace carillon::air
