// Distance field against brute-force distances.
#include <gtest/gtest.h>

#include <cmath>

#include "precompute/mesher/distance_field.hpp"
#include "precompute/mesher/nearest.hpp"
#include "tests/unit/precompute/mesher/surfaces.hpp"

namespace carillon::mesher {
namespace {

using namespace testing;

/// Largest error of samples within both reaches, in voxels.
double calc_worst(const TriangleSurface& surface, double voxel_m, const FieldReach& reach) {
  const DistanceField field = calc_distance_field(surface, voxel_m, reach, 0);
  const NearestPoint nearest(surface);
  double worst = 0;
  for (std::int32_t k = 0; k < field.size[2]; ++k)
    for (std::int32_t j = 0; j < field.size[1]; ++j)
      for (std::int32_t i = 0; i < field.size[0]; ++i) {
        const Vec3 p{field.origin[0] + voxel_m * i, field.origin[1] + voxel_m * j, field.origin[2] + voxel_m * k};
        const double exact = norm(nearest.find(p) - p), found = field.sample(i, j, k);
        if (exact > (found < 0 ? reach.inside_m : reach.outside_m)) continue;
        worst = std::max(worst, std::abs(std::abs(found) - exact) / voxel_m);
      }
  return worst;
}

TEST(distances, rough_ball_and_torus) {
  const auto check = [](const Polygons& body) { return calc_worst(to_triangles(body), 0.0015, {0.006, 0.018}); };
  // The noise is up to a third of the triangles' edges; the bound covers propagation errors at its spikes.
  EXPECT_LT(check(roughen(make_sphere(0.05, 4), 0.3)), 0.07);
  EXPECT_LT(check(make_sphere(0.05, 2)), 0.001);
  EXPECT_LT(check(roughen(make_torus(0.05, 0.02, 60, 24), 0.2)), 0.07);
}

}  // namespace
}  // namespace carillon::mesher
