#include "runtime/scene/strikes.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/catch_message.hpp"
#include "tests/unit/runtime/synth/cube_bank.hpp"

namespace carillon::scene {
namespace {

/// Impulses of strikes without mallets, in order of time.
std::vector<physics::Impulse> make_impulses(const Scene& scene, const std::vector<const bank::Bank*>& banks) {
  std::vector<physics::Impulse> impulses;
  for (const events::Event& event : make_strikes(scene, banks).events) impulses.push_back(std::get<events::Impulse>(event));
  return impulses;
}

class StrikesOfAScene : public ::testing::Test {
 protected:
  StrikesOfAScene() : bank_(testing::make_cube_bank({{1000.0, 1.0}})) {
    scene_.file = "scene.json";
    scene_.duration_s = 1.0;
    scene_.bodies.resize(1);
    scene_.bodies[0].name = "cube";
  }
  physics::Impulse strike(const Vec3& point) {
    scene_.strikes = {{.place = "scene.json:7",
                       .body = 0,
                       .time_s = 0.25,
                       .point_m = point,
                       .triangle = {},
                       .impulse_n_s = {1, 2, 3},
                       .duration_s = 1e-3}};
    return make_impulses(scene_, {&bank_}).at(0);
  }
  Vec3 find_place(const physics::Impulse& impulse) const {
    Vec3 place{};
    for (int corner = 0; corner < 3; ++corner) {
      const Vec3& vertex = bank_.vertices_m[bank_.triangles[impulse.triangle][corner]];
      for (int k = 0; k < 3; ++k) place[k] += impulse.barycentric[corner] * vertex[k];
    }
    return place;
  }
  bank::Bank bank_;
  Scene scene_;
};

TEST_F(StrikesOfAScene, PointOfTheSurfaceIsStruck) {
  for (const Vec3& point : {Vec3{0.05, 0.01, -0.02}, Vec3{-0.03, 0.05, 0.04}, Vec3{0.0, 0.0, -0.05}, Vec3{0.05, 0.05, 0.05}}) {
    const physics::Impulse impulse = strike(point);
    EXPECT_NEAR(impulse.barycentric[0] + impulse.barycentric[1] + impulse.barycentric[2], 1.0, 1e-12);
    for (int k = 0; k < 3; ++k) EXPECT_NEAR(find_place(impulse)[k], point[k], 1e-12);
    EXPECT_EQ(impulse.time_s, 0.25);
    EXPECT_EQ(impulse.body, 0);
    EXPECT_EQ(impulse.other, -1);
    EXPECT_EQ(impulse.impulse_n_s, (Vec3{1, 2, 3}));
    EXPECT_EQ(impulse.duration_s, 1e-3);
  }
}

TEST_F(StrikesOfAScene, PointNextToTheSurfaceStrikesTheNearestPoint) {
  // For a cube and any point outside: each coordinate clamped to the cube.
  for (int i = 0; i < 1000; ++i) {
    const Vec3 point{0.09 * std::sin(1.0 + 1.7 * i), 0.09 * std::sin(2.0 + 2.9 * i), 0.09 * std::sin(3.0 + 4.3 * i)};
    Vec3 nearest = point;
    double miss = 0.0;
    for (int k = 0; k < 3; ++k) {
      nearest[k] = std::fmin(std::fmax(point[k], -0.05), 0.05);
      miss += (nearest[k] - point[k]) * (nearest[k] - point[k]);
    }
    if (miss == 0.0 || std::sqrt(miss) > 0.04) continue;
    const physics::Impulse impulse = strike(point);
    for (int k = 0; k < 3; ++k) ASSERT_NEAR(find_place(impulse)[k], nearest[k], 1e-12) << i;
    for (const double weight : impulse.barycentric) ASSERT_TRUE(weight >= -1e-12 && weight <= 1.0 + 1e-12) << i;
  }
}

TEST_F(StrikesOfAScene, PointFarAwayIsRefused) {
  tests::expect_error<InputError>({"scene.json:7:", "49.95 m away", "\"cube\"", "[0.05, 0, 0]"}, [&] { strike({50.0, 0.0, 0.0}); });
}

TEST_F(StrikesOfAScene, TriangleIsStruckAtItsCentreAndMustExist) {
  scene_.strikes = {{.place = "scene.json:7", .body = 0, .time_s = 0.25, .point_m = {}, .triangle = 11, .impulse_n_s = {0, 0, 1}}};
  const Vec3 place = find_place(make_impulses(scene_, {&bank_}).at(0));  // of the corners 1, 7, 5
  EXPECT_NEAR(place[0], 0.05, 1e-12);
  EXPECT_NEAR(place[1], -0.05 / 3.0, 1e-12);
  EXPECT_NEAR(place[2], 0.05 / 3.0, 1e-12);
  scene_.strikes[0].triangle = 12;
  tests::expect_error<InputError>({"scene.json:7:", "triangle", "12", "\"cube\""}, [&] { make_impulses(scene_, {&bank_}); });
}

TEST_F(StrikesOfAScene, AreEqualWithoutVariation) {
  scene_.strikes.assign(4000, {.place = "scene.json:7",
                               .body = 0,
                               .time_s = 0.25,
                               .point_m = Vec3{0.05, 0.01, -0.02},
                               .triangle = {},
                               .impulse_n_s = {-0.3, 0.4, 1.2},
                               .duration_s = 1e-3});
  const std::vector<physics::Impulse> equal = make_impulses(scene_, {&bank_});
  for (const physics::Impulse& one : {equal[1], equal[3999]}) {
    EXPECT_EQ(one.impulse_n_s, equal[0].impulse_n_s);
    EXPECT_EQ(one.barycentric, equal[0].barycentric);
    EXPECT_EQ(one.duration_s, equal[0].duration_s);
  }
  scene_.bodies[0].variation = 1.0;
  const std::vector<physics::Impulse> varied = make_impulses(scene_, {&bank_});
  double energy = 0.0, scatter = 0.0, length = 0.0, way = 0.0, farthest = 0.0, max_turned = 0.0;
  for (const physics::Impulse& one : varied) {
    const Vec3 &j = one.impulse_n_s, place = find_place(one);
    const double square = (j[0] * j[0] + j[1] * j[1] + j[2] * j[2]) / 1.69;
    energy += square, scatter += (square - 1.0) * (square - 1.0), length += one.duration_s;
    const double along = (-0.3 * j[0] + 0.4 * j[1] + 1.2 * j[2]) / 1.3 / std::sqrt(square * 1.69);
    max_turned = std::max(max_turned, std::acos(std::min(1.0, along)));
    EXPECT_NEAR(place[0], 0.05, 1e-12) << "it stays on the face";
    const double moved = std::hypot(place[1] - 0.01, place[2] + 0.02);
    way += moved * moved, farthest = std::max(farthest, moved);
    EXPECT_EQ(one.time_s, 0.25);
  }
  const double n = 4000.0;
  EXPECT_NEAR(energy / n, 1.0, 3.0 * 0.18 / std::sqrt(n)) << "the mean energy stays";
  EXPECT_NEAR(std::sqrt(scatter / n), 0.18, 0.01);
  EXPECT_NEAR(length / n, 1e-3, 0.01e-3);
  EXPECT_NEAR(std::sqrt(way / n), 2e-3 * std::sqrt(2.0), 0.1e-3);
  EXPECT_LT(farthest, 10e-3);
  EXPECT_LT(max_turned, 0.25);
  EXPECT_NE(varied[0].impulse_n_s, varied[1].impulse_n_s);
  // The same scene gives the same strikes; another name gives others.
  EXPECT_EQ(make_impulses(scene_, {&bank_})[7].impulse_n_s, varied[7].impulse_n_s);
  scene_.bodies[0].name = "box";
  EXPECT_NE(make_impulses(scene_, {&bank_})[7].impulse_n_s, varied[7].impulse_n_s);
  // A tenth of the variation is a tenth of the change.
  scene_.bodies[0].name = "cube";
  scene_.bodies[0].variation = 0.1;
  const physics::Impulse small = make_impulses(scene_, {&bank_})[7];
  EXPECT_NEAR(find_place(small)[1] - 0.01, 0.1 * (find_place(varied[7])[1] - 0.01), 1e-9);
}

}  // namespace
}  // namespace carillon::scene
