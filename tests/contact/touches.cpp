// find_touches itself, on Simbody's own sphere and brick. C++17, as all that includes Simbody.
#include <Simbody.h>
#include <gtest/gtest.h>

#include "runtime/contact/touch.hpp"

namespace carillon::contact {
namespace {

using SimTK::Transform;
using SimTK::Vec3;

Surface make_surface(const SimTK::PolygonalMesh& mesh) {
  Vertices vertices;
  Triangles triangles;
  for (int v = 0; v < mesh.getNumVertices(); ++v) {
    const Vec3& x = mesh.getVertexPosition(v);
    vertices.push_back({x[0], x[1], x[2]});
  }
  for (int f = 0; f < mesh.getNumFaces(); ++f) {
    for (int k = 2; k < mesh.getNumVerticesForFace(f); ++k) {
      triangles.push_back({mesh.getFaceVertex(f, 0), mesh.getFaceVertex(f, k - 1), mesh.getFaceVertex(f, k)});
    }
  }
  return Surface(vertices, triangles, "test");
}

constexpr double kRadius = 0.04;

class SunkBall : public testing::Test {
 protected:
  const Surface ball = make_surface(SimTK::PolygonalMesh::createSphereMesh(kRadius, 4));
  const Surface brick = make_surface(SimTK::PolygonalMesh::createBrickMesh(Vec3(0.2, 0.2, 0.05), 1));

  /// The ball's vertices that touch when its lowest point is so deep in the brick's upper face, and how deep each is.
  std::vector<TouchPoint> find(double depth_m) const {
    std::vector<TouchPoint> on_ball;
    NearFaces near;
    for (const TouchPoint& t :
         find_touches(0, ball, Transform(Vec3(0.031, 0.017, 0.05 + kRadius - depth_m)), 1, brick, Transform(), near)) {
      if (t.feature[0] == 0) on_ball.push_back(t);
    }
    return on_ball;
  }
};

TEST_F(SunkBall, CarriesOnItsLowestVertexWhenItHardlyTouches) {
  const auto touches = find(2e-5);
  ASSERT_EQ(touches.size(), 1U);
  EXPECT_NEAR(touches[0].depth_m, 2e-5, 1e-9);
  EXPECT_NEAR(touches[0].normal[2], 1.0, 1e-12);
}

TEST_F(SunkBall, CarriesOnManyVerticesOnceTheyAreDeeperThanAFiveHundredthOfItsSize) {
  // By the rule of neighbours the lowest alone would carry. (It may be missing here: its faces are buried below the brick's.)
  const double depth = 1e-3, sunk = 2e-3 * ball.size_m();
  const auto touches = find(depth);
  EXPECT_GE(touches.size(), 4U);
  for (const TouchPoint& t : touches) {
    EXPECT_GT(t.depth_m, sunk);
    EXPECT_NEAR(t.depth_m, depth - kRadius - ball.vertex(t.feature[1])[2], 1e-9);
  }
}

TEST_F(SunkBall, DoesNotTouchWhatItIsNotIn) { EXPECT_TRUE(find(-1e-6).empty()); }

}  // namespace
}  // namespace carillon::contact
