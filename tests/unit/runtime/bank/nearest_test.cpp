// Closest surface point against its definition: no other surface point is closer.
#include "runtime/bank/nearest.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <random>

#include "tests/unit/runtime/bank/example_bank.hpp"

namespace carillon::bank {
namespace {

Vec3 calc_place(const Bank& bank, std::size_t triangle, const Vec3& weight) {
  Vec3 place{};
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t k = 0; k < 3; ++k) place[k] += weight[i] * bank.vertices_m[bank.triangles[triangle][i]][k];
  }
  return place;
}

/// Random triangles, some of zero area or zero length.
Bank make_heap(int triangles, std::mt19937& random) {
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  Bank bank;
  for (int t = 0; t < triangles; ++t) {
    const Vec3 base{unit(random), unit(random), unit(random)};
    const auto first = static_cast<std::int32_t>(bank.vertices_m.size());
    for (int i = 0; i < 3; ++i) {
      Vec3 corner = base;
      if (t % 7 != 0) {
        for (double& x : corner) x += 0.2 * unit(random);
      }
      if (t % 5 == 0 && i == 2) {  // on the line through the other two
        for (std::size_t k = 0; k < 3; ++k) corner[k] = 0.3 * bank.vertices_m[first][k] + 0.7 * bank.vertices_m[first + 1][k];
      }
      bank.vertices_m.push_back(corner);
    }
    bank.triangles.push_back({first, first + 1, first + 2});
  }
  return bank;
}

void expect_nearest(const Bank& bank, const SurfaceTree& tree, const Vec3& point) {
  const NearestPlace place = tree.find(point);
  ASSERT_GE(place.triangle, 0);
  ASSERT_LT(static_cast<std::size_t>(place.triangle), bank.triangles.size());
  double sum = 0.0;
  for (const double w : place.barycentric) {
    EXPECT_GE(w, 0.0);
    sum += w;
  }
  EXPECT_NEAR(sum, 1.0, 1e-12);
  EXPECT_LT(calc_length(place.point_m - calc_place(bank, static_cast<std::size_t>(place.triangle), place.barycentric)), 1e-12);
  EXPECT_NEAR(place.distance_m, calc_length(place.point_m - point), 1e-12);
  constexpr int kSteps = 8;
  for (std::size_t t = 0; t < bank.triangles.size(); ++t) {
    for (int i = 0; i <= kSteps; ++i) {
      for (int j = 0; i + j <= kSteps; ++j) {
        const Vec3 weight{i / double{kSteps}, j / double{kSteps}, (kSteps - i - j) / double{kSteps}};
        ASSERT_LE(place.distance_m, calc_length(calc_place(bank, t, weight) - point) + 1e-12) << "triangle " << t;
      }
    }
  }
  const NearestPlace plain = find_nearest(bank, point);
  EXPECT_EQ(place.triangle, plain.triangle);
  EXPECT_EQ(place.barycentric, plain.barycentric);
  EXPECT_EQ(place.distance_m, plain.distance_m);
}

TEST(Nearest, IsNearestAndTreeMatchesLinearSearch) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> unit(-1.5, 1.5);
  for (const int triangles : {1, 2, 6, 7, 13, 300}) {
    const Bank bank = make_heap(triangles, random);
    const SurfaceTree tree(bank);
    for (int i = 0; i < 40; ++i) expect_nearest(bank, tree, {unit(random), unit(random), unit(random)});
    for (std::size_t v = 0; v < bank.vertices_m.size(); v += 17) expect_nearest(bank, tree, bank.vertices_m[v]);
  }
}

TEST(Nearest, TiesGoToTheFirstTriangle) {
  Bank bank;
  example::add_box(bank, 6);
  const SurfaceTree tree(bank);
  for (const Vec3& vertex : bank.vertices_m) {  // up to six triangles meet there
    const NearestPlace place = tree.find(vertex);
    EXPECT_EQ(place.distance_m, 0.0);
    for (std::size_t t = 0; t < static_cast<std::size_t>(place.triangle); ++t) {
      for (const std::int32_t corner : bank.triangles[t]) EXPECT_NE(bank.vertices_m[corner], vertex);
    }
  }
  Vec3 centre = example::kCornerM;
  for (std::size_t k = 0; k < 3; ++k) centre[k] += 0.5 * example::kSidesM[k];
  EXPECT_NEAR(tree.find(centre).distance_m, 0.005, 1e-12);
  EXPECT_EQ(tree.find(centre).triangle, find_nearest(bank, centre).triangle);
}

TEST(Nearest, InvalidPointsHaveNone) {
  Bank bank;
  const double nan = std::numeric_limits<double>::quiet_NaN(), inf = std::numeric_limits<double>::infinity();
  EXPECT_EQ(SurfaceTree(bank).find({0, 0, 0}).triangle, -1);
  EXPECT_EQ(find_nearest(bank, {0, 0, 0}).triangle, -1);
  example::add_box(bank, 3);
  const SurfaceTree tree(bank);
  for (const double bad : {nan, inf, -inf, 1.7e308, -1e101}) {
    for (std::size_t k = 0; k < 3; ++k) {
      Vec3 point{0.1, 0.1, 0.1};
      point[k] = bad;
      EXPECT_EQ(tree.find(point).triangle, -1);
      EXPECT_EQ(find_nearest(bank, point).triangle, -1);
    }
  }
  EXPECT_GE(tree.find({1e99, -1e99, 1e99}).triangle, 0);
  EXPECT_GE(tree.find({5e-324, 0, 0}).triangle, 0);
}

}  // namespace
}  // namespace carillon::bank
