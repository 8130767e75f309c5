// Contact. Oracles: restitution and friction of rigid bodies, conservation of momentum and energy, bit-identity.
#include "precompute/simulation/transient/contact.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <numbers>
#include <string>

#include "runtime/base/error.hpp"
#include "tests/support/catch_message.hpp"
#include "tests/support/ranks.hpp"
#include "tests/unit/precompute/simulation/transient/bodies.hpp"

namespace carillon::transient {
namespace {

using job::PlaneObstacle;
using testing::make_box;
using testing::make_law;
using testing::World;

constexpr double kYoung = 1e9;

std::vector<std::array<std::int32_t, 3>> list_triangles(const Assembly& assembly, std::vector<std::int32_t>& body_of) {
  std::vector<std::array<std::int32_t, 3>> triangles;
  for (std::size_t b = 0; b < assembly.bodies.size(); ++b)
    for (const auto& facet : list_skin(assembly, static_cast<std::int32_t>(b))) {
      triangles.push_back({facet[0], facet[1], facet[2]});
      body_of.push_back(static_cast<std::int32_t>(b));
    }
  return triangles;
}

TouchSurface make_surface(const World& world, double kappa = 0.1) {
  std::vector<std::int32_t> body_of;
  const auto triangles = list_triangles(*world.assembly, body_of);
  const std::vector<double> modulus(world.bodies.size(), kYoung), reach(world.bodies.size(), 0.0);
  return make_touch_surface(world.assembly->nodes_m, triangles, body_of, modulus, reach, kappa);
}

mesh::TetMesh make_block(const Vec3& edges_m, const std::array<int, 3>& cells, const Vec3& at_m) {
  mesh::TetMesh mesh = make_box(edges_m, cells, 1);
  for (Vec3& x : mesh.nodes_m) x = x + at_m;
  return mesh;
}

TEST(HuntCrossley, restitution) {
  EXPECT_EQ(calc_hunt_crossley(1.0), 0.0);
  for (const double e : {0.2, 0.5, 0.9}) {
    // A single mass on the spring, in small steps.
    const double a = calc_hunt_crossley(e), k = 1e4, m = 0.1, v0 = 2.0, h = 1e-8;
    double d = 0, v = v0;
    do {
      v -= h / m * k * d * std::max(0.0, 1 + a * v / v0);
      d += h * v;
    } while (d > 0);
    EXPECT_NEAR(-v / v0, e, 1e-3) << e;
  }
}

// A block falls flat on a hard floor: separation speed e times the impact speed, less vibration; the energy book closes.
TEST(Contact, bouncing_block) {
  const double speed = 0.5;
  for (const double restitution : {1.0, 0.6}) {
    World world({{"block", make_block({0.02, 0.02, 0.01}, {2, 2, 1}, {0, 0, 0.0052}), make_law(kYoung, 0.3, 1000, 1e-7), 0.0}});
    MotionOptions options;
    options.sample_rate_hz = 100000;
    Motion motion(world.domain, options);
    // Soft, so that the body moves as one.
    Contacts contacts(world.domain, make_surface(world, 1e-4), {}, {PlaneObstacle{}}, {restitution, 0.0, {}});
    motion.add(contacts);
    motion.set_start([&](std::int32_t, const Vec3&) { return Motion::Start{{}, {0, 0, -speed}}; });
    const double mass = world.calc_mass(), start = 0.5 * mass * speed * speed;
    double worst = 0;
    while (motion.get_time_s() < 0.004) {
      for (int i = 0; i < 20; ++i) motion.advance_sample();
      const EnergyBook book = motion.calc_book();
      const ExternalForces::Energy touch = contacts.calc_energy();
      worst = std::max(worst, std::abs(book.error_j));
      EXPECT_NEAR(book.kinetic_j + book.elastic_j + book.dissipated_j + touch.stored_j + touch.dissipated_j, start, 2e-4 * start);
    }
    EXPECT_LT(worst, 1e-6 * start);
    const double up = motion.calc_momentum().linear[2] / mass;
    EXPECT_NEAR(up / speed, restitution, 0.02) << restitution;
  }
}

// v - mu g t until it stops: a block slides on the floor.
TEST(Contact, coulomb_friction_of_a_block) {
  const double g = 9.81, mu = 0.3, speed = 0.2;
  World world({{"block", make_block({0.02, 0.02, 0.01}, {2, 2, 1}, {0, 0, 0.005}), make_law(1e7, 0.3, 1000, 1e-5), 0.0}});
  MotionOptions options;
  options.sample_rate_hz = 48000;
  options.gravity_m_s2 = {0, 0, -g};
  Motion motion(world.domain, options);
  Contacts contacts(world.domain, make_surface(world, 1e-4), {}, {PlaneObstacle{}}, {0.3, mu, {}});
  motion.add(contacts);
  motion.set_start([&](std::int32_t, const Vec3&) { return Motion::Start{{}, {speed, 0, 0}}; });
  const double mass = world.calc_mass();
  while (motion.get_time_s() < 0.03) motion.advance_sample();
  EXPECT_NEAR(motion.calc_momentum().linear[0] / mass, speed - mu * g * 0.03, 0.01 * speed);
  while (motion.get_time_s() < 0.1) motion.advance_sample();
  EXPECT_NEAR(motion.calc_momentum().linear[0] / mass, 0.0, 0.01 * speed);
  EXPECT_LT(std::abs(motion.calc_book().relative_error), 1e-6);
}

// A ball on a slope of 20 degrees rolls with 5/7 of g sin a; with friction below 2/7 tan a it slips, with g (sin a - mu cos a), and spins
// up by 5/2 mu g cos a / r. On the level a sliding ball without spin finally rolls with 5/7 of its speed, and the book contains the
// friction loss.
TEST(Contact, rolling_and_slipping_ball) {
  const double g = 9.81, radius = 0.01, mass = 0.03, slope = 20.0 * std::numbers::pi / 180.0, along = g * std::sin(slope),
               across = g * std::cos(slope);
  struct Case {
    double mu, along, across, speed, time_s, wanted_m_s, wanted_rad_s, lost_j;
  };
  const double t = 0.1, mu = 0.05, speed = 0.5;
  const Case cases[] = {
      {0.5, along, across, 0.0, t, 5.0 / 7.0 * along * t, 5.0 / 7.0 * along * t / radius, 0.0},
      {mu, along, across, 0.0, t, (along - mu * across) * t, 2.5 * mu * across * t / radius,
       mass * mu * across * (along - 3.5 * mu * across) * t * t / 2},
      {0.3, 0.0, g, speed, t, 5.0 / 7.0 * speed, 5.0 / 7.0 * speed / radius, mass * speed * speed / 7.0},
  };
  World world({{"far", make_block({0.02, 0.02, 0.01}, {2, 2, 1}, {0, 0, 1}), make_law(1e7, 0.3, 1000), 0.0}});
  for (const Case& one : cases) {
    MotionOptions options;
    options.sample_rate_hz = 48000;
    Motion motion(world.domain, options);
    const TouchRules rules{0.5, one.mu, {one.along, 0, -one.across}};
    Contacts contacts(world.domain, make_surface(world), {{radius, mass, {0, 0, radius}, {one.speed, 0, 0}}}, {PlaneObstacle{}}, rules);
    motion.add(contacts);
    while (motion.get_time_s() < one.time_s) motion.advance_sample();
    const BallStriker& ball = contacts.get_strikers()[0];
    EXPECT_NEAR(ball.velocity_m_s[0] / one.wanted_m_s, 1.0, 2e-3) << one.mu;
    EXPECT_NEAR(ball.spin_rad_s[1] / one.wanted_rad_s, 1.0, 2e-3) << one.mu;
    const ExternalForces::Energy energy = contacts.calc_energy();
    const double start = 0.5 * mass * one.speed * one.speed, most = std::max(start, energy.put_in_j);
    EXPECT_NEAR(energy.dissipated_j, one.lost_j, 2e-3 * most) << one.mu;
    EXPECT_NEAR(energy.stored_j + energy.dissipated_j, start + energy.put_in_j, 1e-4 * most) << one.mu;
  }
}

// Two blocks and a ball collide: momentum is conserved, and losses are booked.
TEST(Contact, momentum_and_energy) {
  World world({{"left", make_block({0.02, 0.02, 0.02}, {2, 2, 2}, {-0.0105, 0, 0}), make_law(kYoung, 0.3, 1000, 1e-7), 0.0},
               {"right", make_block({0.02, 0.01, 0.01}, {2, 1, 1}, {0.0105, 0.001, 0.0015}), make_law(kYoung, 0.3, 1200, 1e-7), 0.0}});
  MotionOptions options;
  options.sample_rate_hz = 100000;
  Motion motion(world.domain, options);
  Contacts contacts(world.domain, make_surface(world, 0.01), {{0.004, 0.01, {-0.03, 0.0, 0.0}, {3, 0, 0}}}, {}, {0.8, 0.2, {}});
  motion.add(contacts);
  motion.set_start([&](std::int32_t node, const Vec3&) {
    return Motion::Start{{}, world.assembly->find_body_of_node(node) == 0 ? Vec3{1, 0, 0} : Vec3{-1, 0, 0}};
  });
  const auto find_momentum = [&] {
    const BallStriker& ball = contacts.get_strikers()[0];
    return motion.calc_momentum().linear + ball.mass_kg * ball.velocity_m_s;
  };
  const Vec3 before = find_momentum();
  const auto find_energy = [&] {
    const EnergyBook book = motion.calc_book();
    const ExternalForces::Energy touch = contacts.calc_energy();
    EXPECT_LT(std::abs(book.relative_error), 1e-6);
    return book.kinetic_j + book.elastic_j + book.dissipated_j + touch.stored_j + touch.dissipated_j - touch.put_in_j;
  };
  const double energy = find_energy();
  bool has_touched = false;
  while (motion.get_time_s() < 0.008) {
    for (int i = 0; i < 40; ++i) motion.advance_sample();
    has_touched = has_touched || contacts.count_touching() > 0;
    EXPECT_LT(norm(find_momentum() - before), 1e-9 * norm(before) + 1e-12);
    // Contact begins within a step: error up to half of (omega h)^2 of the spring energy.
    EXPECT_NEAR(find_energy(), energy, 1e-2 * energy);
  }
  EXPECT_TRUE(has_touched);
  EXPECT_LT(contacts.get_strikers()[0].velocity_m_s[0], 1.5);
}

// Without friction forces are central: off-centre impacts cause rotation, and total angular momentum is conserved.
TEST(Contact, angular_momentum_without_friction) {
  World world({{"left", make_block({0.02, 0.02, 0.02}, {2, 2, 2}, {-0.0105, 0, 0}), make_law(kYoung, 0.3, 1000, 1e-7), 0.0},
               {"right", make_block({0.02, 0.01, 0.01}, {2, 1, 1}, {0.0105, 0.006, 0.004}), make_law(kYoung, 0.3, 1200, 1e-7), 0.0}});
  MotionOptions options;
  options.sample_rate_hz = 100000;
  Motion motion(world.domain, options);
  Contacts contacts(world.domain, make_surface(world, 0.01), {}, {}, {0.8, 0.0, {}});
  motion.add(contacts);
  motion.set_start([&](std::int32_t node, const Vec3&) {
    return Motion::Start{{}, world.assembly->find_body_of_node(node) == 0 ? Vec3{1, 0, 0} : Vec3{-1, 0, 0}};
  });
  const Vec3 before = motion.calc_momentum().angular;
  ASSERT_GT(norm(before), 0.0);
  bool has_touched = false;
  while (motion.get_time_s() < 0.006) {
    motion.advance_sample();
    has_touched = has_touched || contacts.count_touching() > 0;
    EXPECT_LT(norm(motion.calc_momentum().angular - before), 1e-9 * norm(before));
  }
  EXPECT_TRUE(has_touched);
}

TEST(Contact, bit_identical_resumption) {
  const auto make = [] {
    return std::vector<SolidBody>{
        {"block", make_block({0.02, 0.02, 0.01}, {2, 2, 1}, {0, 0, 0.0051}), make_law(kYoung, 0.3, 1000, 1e-7), 0.0}};
  };
  const auto run = [&](bool stops) {
    World first(make());
    MotionOptions options;
    options.sample_rate_hz = 100000;
    const auto begin = [&](Motion& motion, Contacts& contacts) {
      motion.add(contacts);
      motion.set_start([&](std::int32_t, const Vec3& x) { return Motion::Start{{}, {0.1 * x[1], 0, -0.5}}; });
    };
    Motion motion(first.domain, options);
    Contacts contacts(first.domain, make_surface(first), {}, {PlaneObstacle{}}, {0.7, 0.3, {}});
    begin(motion, contacts);
    for (int i = 0; i < 40; ++i) motion.advance_sample();
    if (!stops) {
      for (int i = 0; i < 60; ++i) motion.advance_sample();
      return motion.save();
    }
    const std::vector<std::byte> moved = motion.save(), touched = contacts.save();
    World second(make());
    Motion resumed(second.domain, options);
    Contacts again(second.domain, make_surface(second), {}, {PlaneObstacle{}}, {0.7, 0.3, {}});
    begin(resumed, again);
    resumed.load(moved);
    again.load(touched);
    for (int i = 0; i < 60; ++i) resumed.advance_sample();
    return resumed.save();
  };
  EXPECT_EQ(run(false), run(true));
}

// Checksum of the complete state, written on one rank, compared on more.
TEST(Contact, bit_identical_on_ranks) {
  const auto run = [](MPI_Comm comm) {
    World world({{"left", make_block({0.02, 0.02, 0.02}, {2, 2, 2}, {-0.0102, 0, 0.0105}), make_law(kYoung, 0.3, 1000, 1e-7), 0.0},
                 {"right", make_block({0.02, 0.01, 0.01}, {2, 1, 1}, {0.0102, 0.001, 0.012}), make_law(kYoung, 0.3, 1200, 1e-7), 0.0}},
                comm);
    MotionOptions options;
    options.sample_rate_hz = 100000;
    options.gravity_m_s2 = {0, 0, -9.81};
    Motion motion(world.domain, options);
    Contacts contacts(world.domain, make_surface(world), {{0.004, 0.01, {-0.03, 0.0, 0.012}, {3, 0, 0}}}, {PlaneObstacle{}},
                      {0.8, 0.2, {0, 0, -9.81}});
    motion.add(contacts);
    motion.set_start([&](std::int32_t node, const Vec3&) {
      return Motion::Start{{}, world.assembly->find_body_of_node(node) == 0 ? Vec3{1, 0, -1} : Vec3{-1, 0, 0}};
    });
    for (int i = 0; i < 300; ++i) motion.advance_sample();
    EXPECT_GT(world.comm.sum(static_cast<std::int64_t>(contacts.count_touching())) + 1, 0);
    return std::pair(motion.save(), contacts.get_strikers()[0].position_m);
  };
  const auto [all, ball] = run(MPI_COMM_WORLD);
  const auto [alone, ball_alone] = run(MPI_COMM_SELF);
  if (tests::get_rank() == 0) {
    EXPECT_EQ(all, alone);
  }
  EXPECT_EQ(ball, ball_alone);
}

TEST(Contact, initial_overlap) {
  World world({{"block", make_block({0.02, 0.02, 0.01}, {2, 2, 1}, {0, 0, 0.003}), make_law(kYoung, 0.3, 1000), 0.0}});
  MotionOptions options;
  Motion motion(world.domain, options);
  Contacts contacts(world.domain, make_surface(world), {}, {PlaneObstacle{}}, {});
  motion.add(contacts);
  const std::string message = tests::catch_message<InputError>([&] { motion.advance(); });
  EXPECT_NE(message.find("body \"block\" lies 0.002 m deep in obstacle 1"), std::string::npos) << message;
}

}  // namespace
}  // namespace carillon::transient
