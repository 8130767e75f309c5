// Surface coarsening: preserved properties, and refusals.
#include "precompute/mesher/coarsen.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <string>
#include <utility>

#include "runtime/base/error.hpp"
#include "tests/support/catch_message.hpp"
#include "tests/unit/precompute/mesher/surfaces.hpp"

namespace carillon::mesher {
namespace {

using testing::make_sphere;
using testing::make_torus;
using testing::to_triangles;
using tests::catch_message;

/// Each edge is traversed once per direction: closed, edge-manifold, oriented.
bool is_closed(const TriangleSurface& surface) {
  std::map<std::pair<std::int32_t, std::int32_t>, int> passes;
  for (const Triangle& t : surface.triangles)
    for (std::size_t c = 0; c < 3; ++c) ++passes[{t[c], t[(c + 1) % 3]}];
  return std::all_of(passes.begin(), passes.end(), [&](const auto& pass) {
    return pass.second == 1 && passes.contains({pass.first.second, pass.first.first});
  });
}

/// A box whose sides are lattices of triangles, from the origin.
TriangleSurface make_fine_box(const Vec3& size, const std::array<int, 3>& cells) {
  TriangleSurface box;
  std::map<std::array<int, 3>, std::int32_t> numbers;
  const auto add = [&](const std::array<int, 3>& at) {
    const auto [found, is_new] = numbers.try_emplace(at, static_cast<std::int32_t>(box.points.size()));
    if (is_new) box.points.push_back({size[0] * at[0] / cells[0], size[1] * at[1] / cells[1], size[2] * at[2] / cells[2]});
    return found->second;
  };
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::size_t u = (axis + 1) % 3, v = (axis + 2) % 3;
    for (const int side : {0, cells[axis]})
      for (int i = 0; i < cells[u]; ++i)
        for (int j = 0; j < cells[v]; ++j) {
          const auto at = [&](int a, int b) {
            std::array<int, 3> place{};
            place[axis] = side;
            place[u] = i + a;
            place[v] = j + b;
            return add(place);
          };
          for (Triangle t : {Triangle{at(0, 0), at(1, 0), at(1, 1)}, Triangle{at(0, 0), at(1, 1), at(0, 1)}}) {
            if (side == 0) std::swap(t[1], t[2]);
            box.triangles.push_back(t);
          }
        }
  }
  return box;
}

void expect_coarse(const TriangleSurface& fine, std::size_t corners, const std::string& what) {
  const TriangleSurface coarse = coarsen(fine, corners);
  const double count = static_cast<double>(coarse.points.size());
  EXPECT_NEAR(count / static_cast<double>(corners), 1.0, 0.05) << what;
  EXPECT_TRUE(is_closed(coarse)) << what;
  EXPECT_GT(calc_volume(coarse), 0.0) << what;  // outward as before
  EXPECT_NEAR(calc_volume(coarse) / calc_volume(fine), 1.0, 1e-6) << what;
  EXPECT_NEAR(calc_area(coarse) / calc_area(fine), 1.0, 0.05) << what;
  for (const Vec3& p : coarse.points)
    for (const double x : p) ASSERT_TRUE(std::isfinite(x)) << what;
  // Euler: corners - edges + faces, 3 T / 2 edges.
  const auto genus = [](const TriangleSurface& surface) {
    return static_cast<int>(surface.points.size()) - static_cast<int>(surface.triangles.size()) / 2;
  };
  EXPECT_EQ(genus(coarse), genus(fine)) << what;
}

TEST(coarsen, volume_orientation_and_topology) {
  const TriangleSurface ball = to_triangles(make_sphere(0.1, 5));  // 4,098 corners
  for (const std::size_t corners : {2000U, 600U, 150U}) expect_coarse(ball, corners, "ball");
  const TriangleSurface torus = to_triangles(make_torus(1.0, 0.3, 80, 30));
  for (const std::size_t corners : {1200U, 400U}) expect_coarse(torus, corners, "torus");
  const TriangleSurface box = make_fine_box({0.3, 0.2, 0.01}, {60, 40, 2});
  for (const std::size_t corners : {2000U, 600U}) expect_coarse(box, corners, "plate");
}

TEST(coarsen, plate_faces) {
  const TriangleSurface coarse = coarsen(make_fine_box({0.3, 0.2, 0.01}, {60, 40, 2}), 800);
  const Box box = calc_used_box(coarse);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    EXPECT_NEAR(box.low[axis], 0.0, 1e-3);
    EXPECT_NEAR(box.high[axis], (Vec3{0.3, 0.2, 0.01})[axis], 1e-3);
  }
  EXPECT_NEAR(calc_winding(coarse, {0.15, 0.1, 0.005}), 1.0, 1e-9);
  EXPECT_NEAR(calc_winding(coarse, {0.15, 0.1, 0.0105}), 0.0, 1e-9);
}

TEST(coarsen, triangle_quality) {
  const TriangleSurface coarse = coarsen(to_triangles(make_sphere(1.0, 5)), 700);
  double longest = 0.0, sum = 0.0;
  for (const Triangle& t : coarse.triangles)
    for (std::size_t c = 0; c < 3; ++c) {
      const double length = norm(coarse.points[t[(c + 1) % 3]] - coarse.points[t[c]]);
      longest = std::max(longest, length);
      sum += length;
    }
  const double mean = sum / static_cast<double>(3 * coarse.triangles.size());
  EXPECT_LT(longest, 2.0 * mean);
}

TEST(coarsen, no_excess_corners) {
  const TriangleSurface ball = to_triangles(make_sphere(1.0, 2));
  const TriangleSurface same = coarsen(ball, 1000);
  EXPECT_EQ(same.points, ball.points);
  EXPECT_EQ(same.triangles.size(), ball.triangles.size());
  EXPECT_TRUE(is_closed(same));
}

TEST(coarsen, refusals) {
  const TriangleSurface ball = to_triangles(make_sphere(1.0, 3));
  EXPECT_THAT(catch_message<InputError>([&] { coarsen(ball, 11); }), ::testing::HasSubstr("12 corners"));
  TriangleSurface open = ball;
  open.triangles.pop_back();
  EXPECT_THAT(catch_message<InputError>([&] { coarsen(open, 100); }), ::testing::HasSubstr("open"));
  TriangleSurface winged = ball;  // a third triangle on an edge
  winged.points.push_back({3, 0, 0});
  winged.triangles.push_back({ball.triangles[0][0], ball.triangles[0][1], static_cast<std::int32_t>(ball.points.size())});
  EXPECT_THAT(catch_message<InputError>([&] { coarsen(winged, 100); }), ::testing::HasSubstr("does not have two triangles"));
  TriangleSurface turned = ball;  // one that faces the other way
  std::swap(turned.triangles[5][0], turned.triangles[5][1]);
  EXPECT_THROW(coarsen(turned, 100), InputError);
}

}  // namespace
}  // namespace carillon::mesher
