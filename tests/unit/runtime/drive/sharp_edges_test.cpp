// Faces, edges and corners at points of surfaces.
#include "runtime/drive/sharp_edges.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/unit/runtime/physics/geometry/solids.hpp"

namespace carillon::drive::tests {
namespace {

TEST(SharpEdges, BoxHasCornersAlsoOnAFace) {
  const auto box = geometry::tests::make_box({0.1, 0.08, 0.04}, {1, 1, 1});
  const SharpEdges edges(box.vertices, box.triangles, std::sqrt(0.1 * 0.1 + 0.08 * 0.08 + 0.04 * 0.04));
  const Vec3 down{0, 0, -1};
  EXPECT_EQ(edges.count_directions({0.05, 0.04, -0.02}, down), 2);
  EXPECT_EQ(edges.count_directions({0.0, 0.04, -0.02}, down), 1);
  EXPECT_EQ(edges.count_directions({0.0, 0.0, -0.02}, down), 0);
}

TEST(SharpEdges, CylinderLyingFlatHasNoEdge) {
  constexpr double kRadius = 0.02, kHalf = 0.05;
  const auto cylinder = geometry::tests::make_cylinder(kRadius, 2.0 * kHalf, 48);
  const SharpEdges edges(cylinder.vertices, cylinder.triangles, std::hypot(2.0 * kHalf, 2.0 * std::sqrt(2.0) * kRadius));
  for (const double turn : {0.0, 0.05, 1.0}) {  // at vertices of the rim and between them
    const Vec3 radial{std::cos(turn), std::sin(turn), 0.0};
    const auto count = [&](double height, double tilt) {
      return edges.count_directions(kRadius * radial + Vec3{0, 0, height}, std::cos(tilt) * radial + Vec3{0, 0, std::sin(tilt)});
    };
    EXPECT_EQ(count(kHalf, 0.0), 0) << "lies flat";
    EXPECT_EQ(count(kHalf, 0.01), 0);
    EXPECT_EQ(count(kHalf, -0.3), 0) << "leans over the side, as on the edge of another body";
    EXPECT_EQ(count(kHalf, 0.1), 1) << "tilted onto its rim";
    EXPECT_EQ(count(kHalf, 0.8), 1);
    EXPECT_EQ(count(kHalf, 1.5708), 1) << "stands on its flat end";
    EXPECT_EQ(count(0.5 * kHalf, 0.0), 0) << "away from the rim";
  }
}

}  // namespace
}  // namespace carillon::drive::tests
