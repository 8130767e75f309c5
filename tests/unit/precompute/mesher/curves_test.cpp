// Curve preparation for the Delaunay mesher, which shrinks balls without end where two curves come close or one turns back.
#include <gtest/gtest.h>

#include <algorithm>

#include "precompute/mesher/untangle_curves.hpp"

namespace carillon::mesher {
namespace {

double calc_length(const std::vector<Polyline>& curves) {
  double length = 0;
  for (const Polyline& curve : curves)
    for (std::size_t i = 1; i < curve.size(); ++i) length += norm(curve[i] - curve[i - 1]);
  return length;
}

bool is_end(const std::vector<Polyline>& curves, const Vec3& p) {
  return std::any_of(curves.begin(), curves.end(), [&](const Polyline& c) { return c.front() == p || c.back() == p; });
}

TEST(curves, split_at_reversals) {
  // At (2, 0, 0) the interior angle is 45 degrees, at (1, 1, 0) 135.
  const std::vector<Polyline> curves{{{0, 0, 0}, {2, 0, 0}, {1, 1, 0}, {1, 3, 0}}};
  const auto out = untangle_curves(curves, 1e-6);
  ASSERT_EQ(out.size(), 2u);
  EXPECT_TRUE(is_end(out, {2, 0, 0}));
  EXPECT_FALSE(is_end(out, {1, 1, 0}));
  EXPECT_DOUBLE_EQ(calc_length(out), calc_length(curves));
}

TEST(curves, closed_curves) {
  Polyline drop{{0, 0, 0}, {2, 1, 0}, {3, 1, 0}, {3.5, 0, 0}, {3, -1, 0}, {2, -1, 0}, {0, 0, 0}};
  for (std::size_t start = 0; start + 1 < drop.size(); ++start) {
    Polyline curve(drop.begin(), drop.end() - 1);
    std::rotate(curve.begin(), curve.begin() + static_cast<std::ptrdiff_t>(start), curve.end());
    curve.push_back(curve.front());
    const auto out = untangle_curves({curve}, 1e-6);
    // Two, for the mesher puts no corner on a closed curve.
    ASSERT_EQ(out.size(), 2u) << start;
    EXPECT_TRUE(is_end({out[0]}, {0, 0, 0}) && is_end({out[1]}, {0, 0, 0})) << start;
    EXPECT_NEAR(calc_length(out), calc_length({drop}), 1e-12) << start;
  }
}

TEST(curves, sound_curves_unchanged) {
  const std::vector<Polyline> curves{
      {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}}, {{1, 1, 0}, {0, 1, 0}, {0, 0, 0}}, {{5, 0, 0}, {6, 0, 0}, {6, 1, 0}, {5, 1, 0}, {5, 0, 0}}};
  EXPECT_EQ(untangle_curves(curves, 1e-6), curves);
}

TEST(curves, crossing_curves) {
  const auto out = untangle_curves({{{-1, 0, 0}, {1, 0, 0}}, {{0, -2, 0}, {0, 2, 0}}}, 1e-6);
  ASSERT_EQ(out.size(), 1u);
  EXPECT_EQ(out[0].front()[1], -2);
}

TEST(curves, retraced_curve) {
  const auto out = untangle_curves({{{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {1, 1e-9, 0}, {0.5, 1e-9, 0}}}, 1e-6);
  EXPECT_EQ(out, (std::vector<Polyline>{{{0, 0, 0}, {1, 0, 0}, {2, 0, 0}}}));
}

}  // namespace
}  // namespace carillon::mesher
