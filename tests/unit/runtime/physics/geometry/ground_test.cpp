// Bodies on the ground.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <memory>
#include <numbers>
#include <random>
#include <vector>

#include "runtime/physics/geometry/mesh.hpp"
#include "tests/unit/runtime/physics/geometry/solids.hpp"

namespace carillon::geometry::tests {
namespace {

std::vector<Touch> find_touches(const Shape& a, const Frame& frame, double margin, PairMemory& memory) {
  std::vector<Touch> out;
  find_ground_touches(a, frame, 0.0, margin, memory, out);
  return out;
}
std::vector<Touch> find_touches(const Shape& a, const Frame& frame, double margin) {
  PairMemory memory;
  return find_touches(a, frame, margin, memory);
}

TEST(ground, box_on_four_corners_for_any_mesh) {
  for (const int n : {1, 7}) {
    const auto box = make_box({0.06, 0.05, 0.04}, n).make();
    Frame frame;
    frame.position_m = {0.3, 0.1, 0.02 - 1e-6};
    const auto touches = find_touches(*box, frame, 1e-4);
    ASSERT_EQ(touches.size(), 4U);
    for (const Touch& t : touches) {
      EXPECT_NEAR(t.gap_m, -1e-6, 1e-12);
      EXPECT_NEAR(std::abs(t.where_m[0] - 0.3), 0.03, 1e-12);
      EXPECT_FALSE(t.smooth);
    }
    frame.position_m[2] = 0.0202;
    EXPECT_TRUE(find_touches(*box, frame, 1e-4).empty());
  }
}

TEST(ground, constant_corner_id_of_rotating_box) {
  const auto box = make_box({0.06, 0.05, 0.04}, 3).make();
  PairMemory memory;
  std::uint64_t id = 0;
  for (int i = 0; i < 50; ++i) {
    Frame frame;
    frame.rotation = multiply(make_turn({0, 0, 1}, 0.1 * i), make_turn({1, 0.4, 0}, 0.5 + 0.002 * i));
    double low = 0.0;
    for (int c = 0; c < 8; ++c)
      low = std::min(low, dot(frame.rotation[2], Vec3{c & 1 ? 0.03 : -0.03, c & 2 ? 0.025 : -0.025, c & 4 ? 0.02 : -0.02}));
    frame.position_m[2] = -low + 1e-5;
    const auto touches = find_touches(*box, frame, 1e-4, memory);
    ASSERT_EQ(touches.size(), 1U);
    EXPECT_NEAR(touches[0].gap_m, 1e-5, 1e-12);
    if (i > 0) {
      EXPECT_EQ(touches[0].id, id);
    }
    id = touches[0].id;
  }
}

TEST(ground, all_corners_of_facing_side_on_request) {
  const auto box = make_box({0.06, 0.05, 0.004}, 2).make();
  Frame frame;
  frame.rotation = multiply(make_turn({1, 0, 0}, 0.02), make_turn({0, 1, 0}, 0.05));
  std::vector<Touch> touches;
  for (const bool with_all : {false, true}) {
    PairMemory memory;
    find_ground_touches(*box, frame, 0.0, 0.01, memory, touches, with_all);
    EXPECT_EQ(touches.size() == 4U, with_all);
    for (const Touch& t : touches) EXPECT_LT(t.station_a[2], 0.0);  // none of the upper side
  }
}

TEST(ground, lowest_vertex_of_all) {
  const std::shared_ptr<const Shape> shapes[] = {make_lumpy(0.05, 4, 0.2).make(), make_cylinder(0.012, 0.002, 48).make(),
                                                 make_ring(0.02, 0.003, 48, 16).make(), make_cylinder(0.005, 0.2, 24).make()};
  Dice dice(3);
  for (const auto& shape : shapes) {
    Frame frame;
    for (int i = 0; i < 3000; ++i) {
      const double turn = i % 100 == 0 ? 1.0 : i % 20 == 0 ? 0.02 : 0.004;
      frame.rotation = multiply(make_turn(dice.roll_way(), turn), frame.rotation);
      frame.position_m[2] = 0.01 * dice.roll();
      double lowest = Box::kFar;
      for (const Vec3& x : shape->mesh().vertices) lowest = std::min(lowest, dot(frame.rotation[2], x));
      EXPECT_EQ(find_lowest(*shape, frame, 0.001).gap_m, lowest + (frame.position_m[2] - 0.001));
    }
  }
}

/// Height of the lowest point over many turns: the smooth ball has none.
double calc_ripple(int n) {
  const auto ball = make_ball(1.0, n).make();
  Dice dice(7);
  double low = 2.0, high = 0.0;
  for (int i = 0; i < 2000; ++i) {
    Frame frame;
    frame.rotation = dice.roll_turn();
    frame.position_m[2] = 1.0;
    const auto touches = find_touches(*ball, frame, 0.01);
    EXPECT_EQ(touches.size(), 1U);
    if (touches.empty()) continue;
    EXPECT_NEAR(touches[0].curvature_a_per_m, 1.0, 0.03);
    low = std::min(low, 1.0 - touches[0].gap_m);
    high = std::max(high, 1.0 - touches[0].gap_m);
  }
  return high - low;
}

TEST(ground, ball_of_facets_rolls_as_a_ball) {
  const double coarse = calc_ripple(6), fine = calc_ripple(16);  // 720 and 5,120 triangles
  RecordProperty("ripple_720", std::to_string(coarse));
  RecordProperty("ripple_5120", std::to_string(fine));
  EXPECT_LE(coarse, 4e-4);
  EXPECT_LE(fine, 2e-5);
}

TEST(ground, single_touch_of_rolling_ball) {
  const double r = 0.03;
  const auto ball = make_ball(r, 16).make();
  PairMemory memory;
  std::uint64_t id = 0;
  Touch kept;
  for (int i = 0; i < 400; ++i) {
    const double angle = 0.01 * i;
    Frame frame;
    frame.rotation = multiply(make_turn({0.3, 1, 0}, angle), make_turn({1, 2, 3}, 1.0));
    frame.position_m = {r * angle, 0, r};
    const auto touches = find_touches(*ball, frame, 1e-3, memory);
    ASSERT_EQ(touches.size(), 1U);
    const Touch& t = touches[0];
    EXPECT_TRUE(t.smooth);
    EXPECT_NEAR(t.gap_m, 0.0, 3e-5 * r);
    EXPECT_NEAR(norm(t.where_m - Vec3{r * angle, 0, 0}), 0.0, 0.01 * r);
    EXPECT_NEAR(norm(to_world(frame, t.station_a) - t.station_b), std::abs(t.gap_m), 1e-12);
    if (i > 0) {
      EXPECT_EQ(t.id, id);
      refresh(kept, *ball, frame, nullptr, {});
      EXPECT_NEAR(kept.gap_m, t.gap_m, 2e-6 * r);  // patches meet with small kinks
      EXPECT_NEAR(norm(kept.where_m - t.where_m), 0.0, 2e-3 * r);
    }
    id = t.id;
    kept = t;
  }
}

TEST(ground, cylinder_on_line_and_ring) {
  const auto cylinder = make_cylinder(0.02, 0.1, 48).make();
  Frame frame;
  frame.rotation = make_turn({1, 0, 0}, std::numbers::pi / 2);
  frame.position_m[2] = 0.02;
  auto touches = find_touches(*cylinder, frame, 1e-4);
  ASSERT_GE(touches.size(), 2U);
  EXPECT_LE(touches.size(), 4U);
  double low = 1.0, high = -1.0;
  for (const Touch& t : touches) {
    EXPECT_NEAR(t.gap_m, 0.0, 1e-6);
    low = std::min(low, t.where_m[1]);
    high = std::max(high, t.where_m[1]);
  }
  EXPECT_NEAR(high - low, 0.1, 0.002);
  // Slightly tilted, its far end is still within the margin.
  frame.rotation = make_turn({1, 0, 0}, std::numbers::pi / 2 + 5e-4);
  touches = find_touches(*cylinder, frame, 1e-4);
  low = 1.0, high = -1.0;
  for (const Touch& t : touches) {
    low = std::min(low, t.where_m[1]);
    high = std::max(high, t.where_m[1]);
  }
  EXPECT_NEAR(high - low, 0.1, 0.003);
  frame.rotation = make_turn({1, 0, 0}, 0.0);
  frame.position_m[2] = 0.05;
  touches = find_touches(*cylinder, frame, 1e-4);
  EXPECT_EQ(touches.size(), 4U);
  for (const Touch& t : touches) {
    EXPECT_NEAR(t.gap_m, 0.0, 1e-12);
    EXPECT_NEAR(std::hypot(t.where_m[0], t.where_m[1]), 0.02, 1e-5);
  }
}

TEST(ground, both_ends_of_nearly_level_tube) {
  // It lies on the middle of facets, so no vertex is near the ground. An end that is missing sinks unseen while the tube rocks.
  std::vector<std::array<double, 2>> outline;
  for (int n = 0; n <= 20; ++n) outline.push_back({0.04, -0.05 + 0.005 * n});
  for (int n = 20; n >= 0; --n) outline.push_back({0.037, -0.05 + 0.005 * n});
  const std::unique_ptr<Shape> tube = make_lathe(outline, 24, true).make();
  std::mt19937 random(2);
  std::uniform_real_distribution<double> roll(0.0, 6.28), tilt(-1e-3, 1e-3);
  for (int n = 0; n < 40; ++n) {
    Frame frame;
    frame.rotation = multiply(multiply(make_turn({0, 1, 0}, tilt(random)), make_turn({0, 1, 0}, std::numbers::pi / 2)),
                              make_turn({0, 0, 1}, roll(random)));
    frame.position_m[2] = 0.04;
    double least_m = 0.0, most_m = 0.0;
    for (const Touch& t : find_touches(*tube, frame, 5e-4)) {
      least_m = std::min(least_m, t.where_m[0]);
      most_m = std::max(most_m, t.where_m[0]);
    }
    EXPECT_LT(least_m, -0.045) << n;
    EXPECT_GT(most_m, 0.045) << n;
  }
}

TEST(ground, round_rim_of_tilted_coin) {
  const double r = 0.012, tilt = 0.3;
  const auto coin = make_cylinder(r, 0.002, 64).make();
  double low = 1.0, high = -1.0;
  for (int i = 0; i < 200; ++i) {
    Frame frame;
    frame.rotation = multiply(make_turn({1, 0, 0}, tilt), make_turn({0, 0, 1}, 0.0137 * i));
    frame.position_m[2] = r * std::sin(tilt) + 0.001 * std::cos(tilt);
    const auto touches = find_touches(*coin, frame, 1e-5);
    ASSERT_EQ(touches.size(), 1U);
    low = std::min(low, touches[0].gap_m);
    high = std::max(high, touches[0].gap_m);
  }
  EXPECT_LT(high - low, 2e-6 * r);  // the polygon's: 1.2e-3 r sin(tilt)
  EXPECT_NEAR(low, 0.0, 2e-6 * r);
}

TEST(ground, round_rim_of_leaning_bowl) {
  // Upside down on its inner rim, between a cone and a hollow part.
  const double r = 0.07, z = 0.05, tilt = std::numbers::pi - 0.1;
  const auto bowl =
      make_lathe({{0, 0}, {0.04, 0.01}, {0.065, 0.03}, {0.074, 0.048}, {r, z}, {0.061, 0.033}, {0.036, 0.014}, {0, 0.004}}, 48, false)
          .make();
  double low = 1.0, high = -1.0;
  for (int i = 0; i < 200; ++i) {
    Frame frame;
    frame.rotation = multiply(make_turn({1, 0, 0}, tilt), make_turn({0, 0, 1}, 0.0137 * i));
    frame.position_m[2] = r * std::sin(tilt) - z * std::cos(tilt);
    const auto touches = find_touches(*bowl, frame, 2e-5);
    ASSERT_FALSE(touches.empty());
    double least = 1.0;
    for (const Touch& t : touches) least = std::min(least, t.gap_m);
    low = std::min(low, least);
    high = std::max(high, least);
  }
  EXPECT_LT(high - low, 2e-6 * r);  // the polygon's: 2.1e-3 r sin(tilt)
  EXPECT_NEAR(low, 0.0, 2e-6 * r);
}

TEST(ground, feet_between_corners_within_margin) {
  // A plate on a pentagonal foot, its own corners 0.15 mm above the ground: all ten are nearer than the margin.
  const auto plate = make_lathe({{0, 0}, {0.02, 0}, {0.024, 1e-4}, {0.1, 1.5e-4}, {0.1, 0.02}, {0, 0.02}}, 5, false).make();
  for (const double tilt : {0.0, 1e-4, 5e-4}) {
    Frame frame;
    frame.rotation = make_turn({1, 0.3, 0}, tilt);
    int low = 0;
    for (const Touch& t : find_touches(*plate, frame, 2e-4)) low += std::hypot(t.where_m[0], t.where_m[1]) < 0.021 ? 1 : 0;
    EXPECT_GE(low, 3) << tilt;
  }
}

TEST(ground, tip_of_leaning_cone) {
  // However round its mantle is; further than its own angle, 16.7 degrees from the ground, its rim is lower.
  for (const int around : {12, 64}) {
    const auto cone = make_lathe({{0, 0}, {0.03, 0.1}, {0, 0.1}}, around, false).make();
    const double side = std::atan(0.3);
    for (const double lean : {0.0, 0.2, 0.7, 1.2, 1.27, 1.3, 1.35}) {
      Frame frame;
      frame.rotation = make_turn({0, 1, 0}, lean);
      const auto touches = find_touches(*cone, frame, 1e-4);
      ASSERT_FALSE(touches.empty()) << lean;
      double lowest = 1.0;
      for (const Touch& t : touches) lowest = std::min(lowest, t.gap_m);
      const double rim = std::hypot(0.1, 0.03) * std::sin(0.5 * std::numbers::pi - lean - side);
      EXPECT_NEAR(lowest, std::min(0.0, rim), 1e-6) << around << " " << lean;
    }
  }
}

TEST(ground, needle_and_sheet_on_edge) {
  const auto needle = make_box({1e-4, 1e-4, 0.1}, 2).make();
  Frame frame;
  frame.rotation = make_turn({1, 0.2, 0}, 1.2);
  frame.position_m[2] = 0.05 * std::cos(1.2);
  EXPECT_GE(find_touches(*needle, frame, 1e-3).size(), 1U);
  const auto sheet = make_box({0.3, 1e-4, 0.2}, 5).make();
  frame.rotation = make_turn({1, 0, 0}, 0.0);
  frame.position_m[2] = 0.1;
  EXPECT_EQ(find_touches(*sheet, frame, 1e-5).size(), 4U);
}

}  // namespace
}  // namespace carillon::geometry::tests
