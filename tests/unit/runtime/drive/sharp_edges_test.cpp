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
  EXPECT_EQ(edges.find_near({0.05, 0.04, -0.02}).directions, 2);
  EXPECT_EQ(edges.find_near({0.0, 0.04, -0.02}).directions, 1);
  EXPECT_EQ(edges.find_near({0.0, 0.0, -0.02}).directions, 0);
  EXPECT_EQ(edges.find_near({0.0, 0.04, -0.02}).outward, Vec3{}) << "no rim";
  EXPECT_EQ(edges.get_corners().size(), 8U);
}

TEST(SharpEdges, RimOfACylinderHasTheCurvatureOfItsSide) {
  constexpr double kRadius = 0.02, kHalf = 0.05;
  const auto cylinder = geometry::tests::make_cylinder(kRadius, 2.0 * kHalf, 48);
  const geometry::Shape shape(cylinder.vertices, cylinder.triangles);
  const SharpEdges edges(cylinder.vertices, cylinder.triangles, shape.get_size_m());
  for (const double turn : {0.0, 0.05, 1.0}) {  // at vertices of the rim and between them
    const Vec3 radial{std::cos(turn), std::sin(turn), 0.0};
    const NearEdges near = edges.find_near(kRadius * radial + Vec3{0, 0, kHalf});
    EXPECT_EQ(near.directions, 0);
    EXPECT_GT(dot(near.outward, radial), 0.99) << "of the side, not of the end";
    EXPECT_NEAR(shape.find_place(near.rim_m, near.outward).curvature_per_m, 0.5 / kRadius, 0.02 / kRadius);
    EXPECT_EQ(edges.find_near(kRadius * radial + Vec3{0, 0, 0.5 * kHalf}).outward, Vec3{}) << "away from the rim";
  }
  EXPECT_TRUE(edges.get_corners().empty());
}

}  // namespace
}  // namespace carillon::drive::tests
