// Occlusion between surfaces and receivers.
#include "precompute/simulation/emission/visibility.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <utility>
#include <vector>

#include "runtime/base/chance.hpp"
#include "tests/unit/precompute/simulation/emission/motions.hpp"

namespace carillon::emission {
namespace {

using namespace testing;

/// Signed volumes: the segment crosses the triangle if the three tetrahedra on it have the same sign.
bool is_crossed(const Corners& t, const Vec3& from, const Vec3& to) {
  const auto volume = [](const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d) { return dot(cross(b - a, c - a), d - a); };
  if (volume(t[0], t[1], t[2], from) * volume(t[0], t[1], t[2], to) > 0.0) return false;
  const double a = volume(from, to, t[0], t[1]), b = volume(from, to, t[1], t[2]), c = volume(from, to, t[2], t[0]);
  return (a > 0.0) == (b > 0.0) && (b > 0.0) == (c > 0.0);
}

TEST(Visibility, TreeAgainstExhaustiveSearch) {
  std::uint64_t state = 7;
  const auto draw = [&] { return base::to_unit(base::draw(state)); };
  const auto place = [&] { return Vec3{draw(), draw(), draw()}; };
  for (const std::size_t count : {0U, 1U, 5U, 300U}) {
    std::vector<Corners> triangles;
    for (std::size_t i = 0; i < count; ++i) {
      const Vec3 a = place();
      triangles.push_back({a, a + 0.2 * place(), a + 0.2 * place()});
    }
    const Visibility visibility(triangles);
    int hidden = 0;
    for (int i = 0; i < 500; ++i) {
      const Vec3 from = place(), to = place();
      bool is_free = true;
      for (const Corners& one : triangles) is_free = is_free && !is_crossed(one, from, to);
      EXPECT_EQ(visibility.is_free(from, to, -1), is_free);
      hidden += is_free ? 0 : 1;
    }
    if (count == 300) {
      EXPECT_GT(hidden, 50);
      EXPECT_LT(hidden, 490);
    }
  }
}

std::vector<double> hear_behind(const std::vector<job::RigidObstacle>& walls, double speed, Radiation radiation) {
  Options options = make_options(4000, {0.0, 0.0, 1.0}, 4);
  options.radiation = radiation;
  options.has_visibility = true;
  options.walls = walls;
  return hear(make_part(air::testing::make_ball(2, 0.01)), options, [&](const Vec3& x, double t) {
    return Vec3{speed * t, 0.0, 0.0} + 1e-6 * std::sin(kTwoPi * 1000.0 * t) * normalise(x);
  });
}

double find_most(const std::vector<double>& sound, std::size_t begin, std::size_t end) {
  double most = 0.0;
  for (std::size_t n = begin; n < end; ++n) most = std::max(most, std::abs(sound[n]));
  return most;
}

TEST(Visibility, BodyBehindAWall) {
  const std::vector<job::RigidObstacle> wall{job::BoxObstacle{{-3, -3, 0.4}, {3, 3, 0.5}}};
  for (const Radiation radiation : {Radiation::kPaper2001, Radiation::kRayleigh}) {
    EXPECT_EQ(find_most(hear_behind(wall, 0.0, radiation), 0, 4000), 0.0);
    EXPECT_GT(find_most(hear_behind({}, 0.0, radiation), 1000, 4000), 1e-9);
  }
  EXPECT_GT(find_most(hear_behind(wall, 0.0, Radiation::kKirchhoff), 1000, 4000), 1e-9);
}

// A sheet has each triangle on both sides: the side that faces the receiver is visible and hides the other one.
TEST(Visibility, NearSideOfASheet) {
  const auto listen = [](bool has_both, Radiation radiation) {
    SurfacePart part;
    part.nodes_m = {{-0.01, -0.01, 0}, {0.01, -0.01, 0}, {0.01, 0.01, 0}, {-0.01, 0.01, 0}};
    part.node_number = {0, 1, 2, 3};
    part.triangles = {{0, 1, 2}, {0, 2, 3}};
    if (has_both) part.triangles.insert(part.triangles.end(), {{0, 2, 1}, {0, 3, 2}});
    for (std::size_t t = 0; t < part.triangles.size(); ++t) part.triangle_number.push_back(static_cast<std::int64_t>(t));
    part.body.assign(part.triangles.size(), 0);
    Options options = make_options(2000, {0.1, 0.2, 1.0}, 4);
    options.radiation = radiation;
    options.has_visibility = true;
    return hear(part, options, [](const Vec3&, double t) { return Vec3{0, 0, 1e-6 * std::sin(kTwoPi * 1000.0 * t)}; });
  };
  for (const Radiation radiation : {Radiation::kRayleigh, Radiation::kPaper2001}) {
    const std::vector<double> both = listen(true, radiation), near = listen(false, radiation);
    EXPECT_GT(find_most(near, 0, near.size()), 0.0);
    EXPECT_EQ(both, near);
  }
}

TEST(Visibility, FadeWithoutClick) {
  // The edge is at x = 0.2, halfway; the body passes it at 10 m/s.
  const std::vector<job::RigidObstacle> wall{job::BoxObstacle{{0.1, -5, 0.49}, {9, 5, 0.5}}};
  const auto sound = hear_behind(wall, 10.0, Radiation::kRayleigh);
  const double before = find_most(sound, 300, 700);
  EXPECT_EQ(find_most(sound, 2000, 4000), 0.0);
  EXPECT_GT(before, 1e-9);
  // A 1 kHz tone at 48 kHz has a second difference of (2 pi / 48)^2; a click has one of its own amplitude.
  double most = 0.0;
  for (std::size_t n = 300; n < 2000; ++n) most = std::max(most, std::abs(sound[n + 1] - 2.0 * sound[n] + sound[n - 1]));
  EXPECT_LT(most, 2.0 * before * std::pow(kTwoPi / 48.0, 2));
}

TEST(Visibility, ObstacleShadow) {
  const Vec3 from{0, 0, 0}, to{0, 0, 1};
  const auto hides = [&](const job::RigidObstacle& obstacle) {
    EXPECT_EQ(is_between(obstacle, from, to), is_between(obstacle, to, from));
    return is_between(obstacle, from, to);
  };
  EXPECT_TRUE(hides(job::BoxObstacle{{-1, -1, 0.2}, {1, 1, 0.3}}));
  EXPECT_FALSE(hides(job::BoxObstacle{{0.1, -1, 0.2}, {1, 1, 0.3}}));   // next to the way
  EXPECT_FALSE(hides(job::BoxObstacle{{-1, -1, 1.2}, {1, 1, 1.3}}));    // behind the receiver
  EXPECT_FALSE(hides(job::BoxObstacle{{-1, -1, -0.3}, {1, 1, -0.2}}));  // behind the source
  EXPECT_FALSE(hides(job::BoxObstacle{{0, -1, 0.2}, {1, 1, 0.3}}));     // the way runs along a side
  EXPECT_TRUE(hides(job::BoxObstacle{{-1, -1, 0.9}, {1, 1, 1.1}}));     // the receiver is inside
  EXPECT_TRUE(hides(job::BallObstacle{{0.05, 0, 0.5}, 0.06}));
  EXPECT_FALSE(hides(job::BallObstacle{{0.05, 0, 0.5}, 0.04}));
  EXPECT_FALSE(hides(job::BallObstacle{{0, 0, 1.5}, 0.4}));
  EXPECT_TRUE(hides(job::BallObstacle{{0, 0, 1.1}, 0.2}));
  EXPECT_FALSE(hides(job::PlaneObstacle{{0, 0, -0.1}, {0, 0, 1}}));
  EXPECT_TRUE(hides(job::PlaneObstacle{{0, 0, 0.5}, {0, 0, 1}}));
  EXPECT_TRUE(hides(job::PlaneObstacle{{0, 0, 1.5}, {0, 0, 1}}));  // both lie in it
  EXPECT_TRUE(is_between(job::BoxObstacle{{-1, -1, -1}, {1, 1, 1}}, from, from));
  EXPECT_FALSE(is_between(job::BoxObstacle{{1, -1, -1}, {2, 1, 1}}, from, from));
}

/// Sound of a ball behind a silent square plate that moves along x.
std::vector<double> hear_behind_plate(double from_x, double speed, Radiation radiation) {
  Options options = make_options(3000, {0.0, 0.0, 1.0}, 4);
  options.radiation = radiation;
  options.has_visibility = true;
  SurfacePart part = make_part(air::testing::make_ball(2, 0.01));
  const auto first = static_cast<std::int32_t>(part.nodes_m.size());
  for (const auto& [x, y] : {std::pair{-0.1, -0.1}, {0.1, -0.1}, {0.1, 0.1}, {-0.1, 0.1}}) {
    part.node_number.push_back(static_cast<std::int64_t>(part.nodes_m.size()));
    part.nodes_m.push_back({from_x + x, y, 0.5});
  }
  part.silent = {{first, first + 1, first + 2}, {first, first + 2, first + 3}};
  return hear(part, options, [&](const Vec3& x, double t) {
    return x[2] > 0.4 ? Vec3{speed * t, 0.0, 0.0} : 1e-6 * std::sin(kTwoPi * 1000.0 * t) * normalise(x);
  });
}

TEST(Visibility, MovingSilentSurface) {
  for (const Radiation radiation : {Radiation::kPaper2001, Radiation::kRayleigh}) {
    EXPECT_EQ(find_most(hear_behind_plate(0.0, 0.0, radiation), 0, 3000), 0.0);
    const std::vector<double> free = hear_behind_plate(5.0, 0.0, radiation);
    EXPECT_GT(find_most(free, 1000, 3000), 1e-9);
    // At 20 m/s its edge reaches the line of sight after 20 ms: 960 samples.
    const std::vector<double> shut = hear_behind_plate(0.5, -20.0, radiation);
    for (std::size_t n = 0; n < 900; ++n) ASSERT_EQ(shut[n], free[n]) << n;
    EXPECT_EQ(find_most(shut, 1250, 1480), 0.0);
    EXPECT_GT(find_most(shut, 1800, 3000), 1e-9);  // the plate has passed
  }
}

TEST(Visibility, PassingBall) {
  const SurfacePart part = make_part(air::testing::make_ball(2, 0.01));
  const auto play = [&](double begin_y, std::size_t stop_at) {
    Options options = make_options(3000, {0.0, 0.0, 1.0}, 4);
    options.radiation = Radiation::kRayleigh;
    options.has_visibility = true;
    options.ball_radius_m = {0.1};
    auto sound = std::make_unique<Emission>(MPI_COMM_SELF, part, options);
    for (std::size_t n = 0; n <= 12000; ++n) {
      const double t = static_cast<double>(n) / 192e3;
      if (n == stop_at) {  // checkpoint and resumption
        const std::vector<std::byte> state = sound->save();
        sound = std::make_unique<Emission>(MPI_COMM_SELF, part, options);
        sound->load(state);
      }
      if (n % 4 == 0) sound->set_balls(std::vector<Vec3>{{0.0, begin_y + 20.0 * t, 0.5}});
      sound->add_step(calc_displacement(
                          part, [&](const Vec3& x, double time) { return 1e-6 * std::sin(kTwoPi * 1000.0 * time) * normalise(x); }, t)
                          .data());
    }
    sound->finish();
    return sound->calc_sound(0);
  };
  const std::vector<double> free = play(1.0, 0), crossed = play(-0.5, 0);
  for (std::size_t n = 0; n < 900; ++n) ASSERT_EQ(crossed[n], free[n]) << n;
  EXPECT_EQ(find_most(crossed, 1250, 1400), 0.0);
  EXPECT_GT(find_most(crossed, 2000, 3000), 1e-9);
  EXPECT_EQ(play(-0.5, 4321), crossed);
}

}  // namespace
}  // namespace carillon::emission
