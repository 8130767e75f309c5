// Boxes on boxes.
#include <gtest/gtest.h>

#include <set>

#include "tests/unit/runtime/physics/geometry/solids.hpp"

namespace carillon::geometry::tests {
namespace {

TEST(polyhedra, corners_of_flush_overlap) {
  const auto small = make_box({0.06, 0.05, 0.04}, 4).make(), large = make_box({0.1, 0.03, 0.04}, 1).make();
  Frame top, bottom;
  top.position_m = {0.03, 0, 0.04 + 1e-6};
  const auto touches = find(*small, top, *large, bottom, 1e-4);
  ASSERT_EQ(touches.size(), 4U);
  std::set<std::uint64_t> ids;
  for (const Touch& t : touches) {
    EXPECT_NEAR(t.gap_m, 1e-6, 1e-12);
    EXPECT_NEAR(t.normal[2], 1.0, 1e-12);
    EXPECT_NEAR(std::abs(t.where_m[0] - 0.025), 0.025, 1e-9);
    EXPECT_NEAR(std::abs(t.where_m[1]), 0.015, 1e-9);
    EXPECT_NEAR(norm(to_world(top, t.station_a) - to_world(bottom, t.station_b)), 1e-6, 1e-12);
    ids.insert(t.id);
  }
  EXPECT_EQ(ids.size(), 4U);
  // The same box on itself: corners in the planes of the sides.
  top.position_m = {0, 0, 0.04 - 1e-6};
  EXPECT_EQ(find(*small, top, *small, bottom, 1e-4).size(), 4U);
}

TEST(polyhedra, sliding_over_flush_seam) {
  // A tile comes over the edge of a board whose face it slides in, from 1 um too high to 1 um too deep: no touch is across its way.
  const auto tile = make_box({0.08, 0.06, 0.02}, 2).make(), board = make_box({0.4, 0.3, 0.04}, 1).make();
  for (const double x : {-0.241, -0.2401, -0.240002, -0.24 - 1e-9}) {
    for (const double lift : {-1e-6, -1e-11, 0.0, 1e-11, 1e-6}) {
      Frame above, below;
      above.position_m = {x, 0, 0.03 + lift};
      for (const Touch& t : find(*tile, above, *board, below, 2e-3)) EXPECT_NEAR(t.normal[2], 1.0, 1e-12) << x << " " << lift;
      above.position_m = {x + 0.01, 0, 0.03 + lift};
      const auto touches = find(*tile, above, *board, below, 2e-3);
      EXPECT_EQ(touches.size(), 4U) << x << " " << lift;
      for (const Touch& t : touches) EXPECT_NEAR(t.normal[2], 1.0, 1e-12) << x << " " << lift;
    }
    Frame above, below;
    above.position_m = {x, 0, 0.03 - 1e-5};
    const auto touches = find(*tile, above, *board, below, 2e-3);  // a step of 10 um
    ASSERT_FALSE(touches.empty()) << x;
    for (const Touch& t : touches) EXPECT_NEAR(t.normal[0], -1.0, 1e-12) << x;
  }
}

TEST(polyhedra, single_point_of_crossed_edges) {
  const auto bar = make_box({0.2, 0.02, 0.02}, 2).make();
  Frame below, above;
  below.rotation = make_turn({1, 0, 0}, std::numbers::pi / 4);
  above.rotation = multiply(make_turn({0, 0, 1}, 1.0), below.rotation);
  above.position_m = {0.01, 0.005, 0.02 * std::sqrt(2.0) + 1e-5};
  const auto touches = find(*bar, above, *bar, below, 1e-4);
  ASSERT_EQ(touches.size(), 1U);
  EXPECT_NEAR(touches[0].gap_m, 1e-5, 1e-9);
  EXPECT_NEAR(touches[0].normal[2], 1.0, 1e-9);
  Touch t = touches[0];
  above.position_m = {0.012, 0.004, 0.02 * std::sqrt(2.0) - 1e-5};
  PairMemory memory;
  refresh(t, *bar, above, bar.get(), below);
  EXPECT_NEAR(t.gap_m, -1e-5, 1e-9);
  EXPECT_NEAR(norm(to_world(above, t.station_a) - to_world(below, t.station_b)), 1e-5, 1e-9);
}

/// How far two boxes are apart, or must be moved apart at the least: all ways that can be the one, without any choice among them.
double calc_gap(const Solid& a, const Frame& fa, const Solid& b, const Frame& fb) {
  double best = -1.0;
  const auto test = [&](const Vec3& way) {
    if (norm(way) < 1e-9) return;
    for (const double sign : {1.0, -1.0}) {
      const Vec3 n = sign * normalise(way);
      double low = 1e9, high = -1e9;
      for (const Vec3& x : a.vertices) low = std::min(low, dot(n, to_world(fa, x)));
      for (const Vec3& x : b.vertices) high = std::max(high, dot(n, to_world(fb, x)));
      best = std::max(best, low - high);
    }
  };
  const auto axis = [](const Frame& f, int k) { return Vec3{f.rotation[0][k], f.rotation[1][k], f.rotation[2][k]}; };
  for (int i = 0; i < 3; ++i) {
    test(axis(fa, i));
    test(axis(fb, i));
    for (int j = 0; j < 3; ++j) test(cross(axis(fa, i), axis(fb, j)));
  }
  if (best <= 0.0) return best;
  for (const Vec3& x : a.vertices) {
    const Vec3 p = to_world(fa, x);
    for (const Vec3& y : b.vertices) {
      const Vec3 d = p - to_world(fb, y);
      test(d);
      for (int j = 0; j < 3; ++j) test(d - dot(d, axis(fb, j)) * axis(fb, j)), test(d - dot(d, axis(fa, j)) * axis(fa, j));
    }
  }
  return best;
}

TEST(polyhedra, deepest_touch_equals_separation) {
  const Solid sa = make_box({0.06, 0.05, 0.04}), sb = make_box({0.04, 0.09, 0.03});
  const auto a = sa.make(), b = sb.make();
  Dice dice(11);
  int compared = 0;
  for (int i = 0; i < 400; ++i) {
    Frame fa, fb;
    fa.rotation = dice.roll_turn();
    fb.rotation = dice.roll_turn();
    const Vec3 way = dice.roll_way();
    double apart = 0.2;  // to the touch, by halving
    for (double part = 0.1; part > 1e-6; part *= 0.5) {
      fa.position_m = apart * way;
      apart += calc_gap(sa, fa, sb, fb) > 0.0 ? -part : part;
    }
    fa.position_m = (apart + dice.roll(-5e-4, 1.5e-3)) * way;
    const double gap = calc_gap(sa, fa, sb, fb);
    const auto touches = find(*a, fa, *b, fb, 1e-3);
    if (gap > 1e-3) {
      EXPECT_TRUE(touches.empty()) << i << " " << gap;
      continue;
    }
    ASSERT_FALSE(touches.empty()) << i << " " << gap;
    double min = 1.0;
    for (const Touch& t : touches) {
      min = std::min(min, t.gap_m);
      EXPECT_NEAR(t.gap_m, dot(t.normal, to_world(fa, t.station_a) - to_world(fb, t.station_b)), 1e-12);
    }
    EXPECT_NEAR(min, gap, 2e-6) << i;
    ++compared;
  }
  EXPECT_GE(compared, 250);
}

TEST(polyhedra, invariance_to_swap_and_pose) {
  const auto a = make_box({0.06, 0.05, 0.04}, 2).make(), b = make_box({0.1, 0.1, 0.02}, 3).make();
  Frame fa, fb, move;
  fa.rotation = make_turn({0.2, 0.1, 1}, 0.4);
  fa.rotation = multiply(make_turn({1, 0, 0}, 0.01), fa.rotation);
  fa.position_m = {0.01, 0.02, 0.0302};
  move.rotation = make_turn({1, 2, 3}, 2.0);
  move.position_m = {5, -3, 2};
  const auto carry = [&](const Frame& f) { return Frame{multiply(move.rotation, f.rotation), to_world(move, f.position_m)}; };
  const auto here = find(*a, fa, *b, fb, 1e-3), there = find(*a, carry(fa), *b, carry(fb), 1e-3), swapped = find(*b, fb, *a, fa, 1e-3);
  ASSERT_GE(here.size(), 2U);
  ASSERT_EQ(here.size(), there.size());
  ASSERT_EQ(here.size(), swapped.size());
  for (std::size_t i = 0; i < here.size(); ++i) {
    EXPECT_EQ(here[i].id, there[i].id);
    EXPECT_NEAR(here[i].gap_m, there[i].gap_m, 1e-14 * 100);
    EXPECT_NEAR(norm(to_world(move, here[i].where_m) - there[i].where_m), 0.0, 1e-12);
    double min = 1.0;
    for (const Touch& t : swapped) min = std::min(min, norm(t.where_m - here[i].where_m) + norm(t.normal + here[i].normal));
    EXPECT_LT(min, 1e-9);
  }
}

TEST(polyhedra, gap_of_a_hundredth_of_a_millimetre_between_a_thousand_to_one) {
  const auto large = make_box({10, 10, 1}, 2).make(), small = make_box({0.01, 0.01, 0.01}, 2).make();
  Frame fa, fb;
  fa.position_m = {3, -2, 0.505 + 1e-5};
  const auto touches = find(*small, fa, *large, fb, 2e-5);
  ASSERT_EQ(touches.size(), 4U);
  for (const Touch& t : touches) EXPECT_NEAR(t.gap_m, 1e-5, 1e-12);
}

}  // namespace
}  // namespace carillon::geometry::tests
