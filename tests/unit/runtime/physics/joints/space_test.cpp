// Bodies on joints and cords among others: impacts, contacts, rest; against closed forms.
#include "runtime/physics/rigid/space.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <numbers>
#include <vector>

#include "tests/unit/runtime/physics/rigid/bodies.hpp"
#include "tests/unit/runtime/physics/rigid/momenta.hpp"

namespace carillon::rigid {
namespace {

constexpr double kG = 9.81;
constexpr Vec3 kGravity{0, 0, -kG};

Solid finish(Solid s, double restitution, double friction) {
  s.restitution = restitution;
  s.friction = friction;
  return s;
}

Solid make_box_solid(double mass_kg, const Vec3& sides, double restitution = 1.0, double friction = 0.0) {
  return finish(make_box(mass_kg, sides), restitution, friction);
}

/// With the inertia of a box of this side.
Solid make_ball_solid(double mass_kg, double radius, double restitution = 1.0, double friction = 0.0) {
  const double side = std::sqrt(2.4) * radius;
  return finish(make_solid(geometry::tests::make_ball(radius, 16), mass_kg, {side, side, side}), restitution, friction);
}

Solid make_wall(const Vec3& sides, double restitution = 1.0, double friction = 0.0) {
  Solid s = make_box_solid(1.0, sides, restitution, friction);
  s.fixed = true;
  return s;
}

State at(const Vec3& centre) {
  State s;
  s.centre = centre;
  return s;
}

joints::Joint hinge(int body, int to, const Vec3& where) {
  return {.kind = joints::Kind::kHinge, .body = body, .to = to, .at = where, .axis = {0, 1, 0}};
}

void run(Space& space, double until_s) {
  while (space.get_time() < until_s - 1e-9) space.step(until_s);
}

/// Steps until something strikes, or to a time.
std::vector<Strike> step_to_first_strikes(Space& space, double end_s) {
  std::vector<Strike> strikes;
  while (strikes.empty() && space.get_time() < end_s) {
    space.step(end_s);
    strikes = space.take_strikes();
  }
  return strikes;
}

TEST(joints, pendulum_against_wall) {
  // A ball of 3 cm that hangs 0.4 m below a hinge is let go at 0.6 rad and meets a wall at the bottom.
  const double r = 0.03, arm = 0.4, mass = 0.5, a = 0.6, e = 0.7;
  std::vector<Solid> solids{make_ball_solid(mass, r, e), make_wall({0.1, 0.2, 0.2}, e)};
  std::vector<State> states{at({arm * std::sin(a), 0, -arm * std::cos(a)}), at({-r - 0.05, 0, -arm})};
  Space space(std::move(solids), std::move(states), std::nullopt, kGravity, {}, {.joints = {hinge(0, -1, {})}, .cords = {}});
  const double before = space.calc_books().calc_total();
  const double inertia = mass * arm * arm + 0.4 * mass * r * r, gained = mass * kG * arm * (1.0 - std::cos(a));
  const std::vector<Strike> strikes = step_to_first_strikes(space, 2.0);
  ASSERT_EQ(strikes.size(), 1u);
  const Strike& hit = strikes.front();
  ASSERT_EQ(hit.bodies, std::vector<int>{0});
  const double speed = arm * std::sqrt(2.0 * gained / inertia);
  EXPECT_NEAR(-hit.before[0].velocity[0], speed, 1e-4 * speed);
  EXPECT_NEAR(hit.after[0].velocity[0], e * speed, 1e-4 * speed);
  // Angular momentum about the hinge: only the wall's impulse changes it.
  EXPECT_NEAR(hit.hits[0].impulse[0] * arm, (1.0 + e) * inertia * speed / arm, 1e-4 * inertia * speed / arm);
  EXPECT_NEAR(space.calc_books().calc_total(), before, 1e-6 * gained);
  // It swings back as far as the energy goes.
  double highest = -1.0;
  while (space.get_time() < hit.time_s + 0.45) {
    space.step(3.0);
    highest = std::max(highest, space.state(0).centre[2]);
  }
  EXPECT_NEAR(mass * kG * (highest + arm), e * e * gained, 1e-3 * gained);
  EXPECT_NEAR(norm(space.state(0).centre), arm, 1e-12);
}

TEST(joints, ball_against_hinged_bar) {
  // Without gravity: a bar hinged at its end, struck across at a distance d; elastic. The bar is there an effective mass I / d^2.
  for (const double d : {0.1, 0.2, 0.27}) {
    const double l = 0.3, bar = 0.4, ball = 0.1, r = 0.01, v = 2.0;
    const Vec3 sides{0.02, 0.02, l};
    std::vector<Solid> solids{make_box_solid(bar, sides), make_ball_solid(ball, r)};
    std::vector<State> states{at({0, 0, -0.5 * l}), at({0.05, 0, -d})};
    states[1].velocity = {-v, 0, 0};
    Space space(std::move(solids), std::move(states), std::nullopt, {}, {}, {.joints = {hinge(0, -1, {})}, .cords = {}});
    run(space, 0.03);
    const double inertia = bar * (l * l + sides[0] * sides[0]) / 12.0 + bar * 0.25 * l * l, m = inertia / (d * d);
    EXPECT_NEAR(space.state(1).velocity[0], -v * (ball - m) / (ball + m), 2e-3 * v) << d;
    const double spin = 2.0 * ball * v / (ball + m) / d;  // of the bar
    EXPECT_NEAR(norm(space.placed(0).spin), spin, 2e-3 * spin) << d;
    EXPECT_NEAR(space.calc_books().calc_total(), 0.5 * ball * v * v, 1e-9);
  }
}

TEST(joints, impulse_through_chain) {
  // Two bars on a hinge, free; a ball strikes one across at its outer end. Momentum and angular momentum of all are kept.
  const Vec3 sides{0.02, 0.02, 0.2};
  std::vector<Solid> solids{make_box_solid(0.2, sides, 0.6, 0.3), make_box_solid(0.3, sides, 0.6, 0.3),
                            make_ball_solid(0.1, 0.01, 0.6, 0.3)};
  std::vector<State> states{at({0, 0, -0.1}), at({0, 0, 0.1}), at({0.05, 0.002, -0.18})};
  states[2].velocity = {-3, 0.2, 0};
  Space space(std::move(solids), std::move(states), std::nullopt, {}, {.joint_tolerance = 1e-12},
              {.joints = {{.kind = joints::Kind::kBall, .body = 0, .to = 1, .at = {}}}, .cords = {}});
  const rigid::Momenta before = rigid::add_up(space);
  run(space, 0.1);
  const rigid::Momenta after = rigid::add_up(space);
  EXPECT_GT(norm(space.state(1).velocity), 0.1);
  EXPECT_LT(norm(after.linear - before.linear), 1e-9 * norm(before.linear));
  EXPECT_LT(norm(after.angular - before.angular), 1e-7 * norm(before.angular));
  const Mat3 r0 = make_rotation(space.state(0).rotation), r1 = make_rotation(space.state(1).rotation);
  EXPECT_LT(norm(space.state(0).centre + r0 * Vec3{0, 0, 0.1} - space.state(1).centre - r1 * Vec3{0, 0, -0.1}), 1e-12);
}

TEST(joints, sleep_and_wake_of_pendulum) {
  std::vector<Solid> solids{make_box_solid(0.3, {0.02, 0.02, 0.3}), make_ball_solid(0.1, 0.01)};
  std::vector<State> states{at({0, 0, -0.15}), at({0.5, 0, -0.25})};
  states[1].velocity = {-1, 0, 2.5};
  Space space(std::move(solids), std::move(states), std::nullopt, kGravity, {}, {.joints = {hinge(0, -1, {})}, .cords = {}});
  run(space, 0.2);
  EXPECT_TRUE(space.is_still(0));
  run(space, 0.55);
  EXPECT_FALSE(space.is_still(0));
  EXPECT_GT(norm(space.placed(0).spin), 0.5);
}

TEST(joints, sleep_of_hanging_chain) {
  std::vector<Solid> solids;
  std::vector<State> states;
  Links links;
  for (int i = 0; i < 20; ++i) {
    solids.push_back(make_box_solid(0.01, {0.01, 0.01, 0.05}, 0.5, 0.3));
    states.push_back(at({0, 0, -0.025 - 0.05 * i}));
    links.joints.push_back({.kind = joints::Kind::kBall, .body = i, .to = i - 1, .at = {0, 0, -0.05 * i}});
  }
  const std::vector<State> start = states;
  Space space(std::move(solids), std::move(states), std::nullopt, kGravity, {}, links);
  run(space, 1.0);
  EXPECT_TRUE(space.is_all_asleep());
  for (int i = 0; i < 20; ++i) EXPECT_LT(norm(space.state(i).centre - start[i].centre), 1e-12);
}

TEST(joints, sleeping_pendulum_in_impact) {
  // A box slides into a second one, which sleeps in touch with a pendulum that hangs asleep. Oracle: all of them in one problem; and
  // the momentum of the boxes and of the pendulum about its hinge, over its arm.
  const double mass = 0.1, arm = 0.5;
  const Vec3 sides{0.06, 0.05, 0.04};
  const Ground ground{.restitution = 0.2, .friction = 0.0, .young_modulus_pa = 10e9, .poisson_ratio = 0.3};
  const auto begin = [&](bool islands) {
    std::vector<Solid> solids(3, make_box_solid(mass, sides, 0.2));
    std::vector<State> states{at({-0.2, 0, 0.02}), at({0, 0, 0.02}), at({0.06, 0, 0.021})};
    states[0].velocity = {0.5, 0, 0};
    Options options;
    options.islands = islands;
    return Space(std::move(solids), std::move(states), ground, kGravity, options,
                 {.joints = {hinge(2, -1, {0.06, 0, 0.021 + arm})}, .cords = {}});
  };
  Space space = begin(true), whole = begin(false);
  const double before_j = space.calc_books().calc_total();
  run(space, 0.27);
  EXPECT_TRUE(space.is_still(1) && space.is_still(2));
  run(space, 0.284);
  run(whole, 0.284);
  for (const int body : {0, 1, 2}) EXPECT_NEAR(space.state(body).velocity[0], whole.state(body).velocity[0], 2e-3) << body;
  EXPECT_GT(space.state(2).velocity[0], 0.1);
  const double inertia = mass * arm * arm + space.solid(2).inertia_kg_m2[1][1];
  const double momentum =
      mass * (space.state(0).velocity[0] + space.state(1).velocity[0]) + inertia / (arm * arm) * space.state(2).velocity[0];
  EXPECT_NEAR(momentum, mass * 0.5, 0.01 * mass * 0.5) << "but for where along the faces they touch, and what gravity took in 4 ms";
  EXPECT_NEAR(space.calc_books().calc_total(), before_j, 1e-6 * mass * 0.5 * 0.5);
}

TEST(joints, rest_of_leaning_pendulum) {
  // A bar on a hinge that leans against a wall 10 degrees off the vertical: moments about the hinge balance.
  const double l = 0.3, mass = 0.4, a = 10.0 * std::numbers::pi / 180.0;
  const Vec3 sides{0.02, 0.02, l};
  std::vector<Solid> solids{make_box_solid(mass, sides, 0.3, 0.2), make_wall({0.1, 0.2, 0.1}, 0.3, 0.2)};
  State bar = at({0.5 * l * std::sin(a), 0, -0.5 * l * std::cos(a)});
  bar.rotation = {std::cos(-0.5 * a), 0, std::sin(-0.5 * a), 0};
  // A ledge whose right edge is 2 mm left of the lower left corner of the bar, and 4 mm above it.
  const double corner_x = l * std::sin(a) - 0.01 * std::cos(a), corner_z = -l * std::cos(a) - 0.01 * std::sin(a);
  std::vector<State> states{bar, at({corner_x - 0.002 - 0.05, 0, corner_z + 0.004 - 0.05})};
  Space space(std::move(solids), std::move(states), std::nullopt, kGravity, {}, {.joints = {hinge(0, -1, {})}, .cords = {}});
  const double before = space.calc_books().calc_total();
  run(space, 2.0);
  EXPECT_TRUE(space.is_still(0));
  EXPECT_NEAR(space.calc_books().calc_total(), before, 0.01 * space.calc_books().lost_j);
  EXPECT_GT(space.calc_books().lost_j, 0.0);
  const Vec3 edge = Vec3{corner_x - 0.002, 0, corner_z + 0.004} - space.state(0).centre;
  EXPECT_NEAR((transpose(make_rotation(space.state(0).rotation)) * edge)[0], -0.01, 3e-6);  // on the bar's left face
}

TEST(joints, slider_on_plate) {
  std::vector<Solid> solids{make_box_solid(0.4, {0.05, 0.05, 0.05}, 0.4, 0.4), make_wall({0.2, 0.2, 0.05}, 0.4, 0.4)};
  std::vector<State> states{at({0, 0, 0.1}), at({})};
  Space space(std::move(solids), std::move(states), std::nullopt, kGravity, {},
              {.joints = {{.kind = joints::Kind::kSlider, .body = 0, .to = -1, .at = {}, .axis = {0, 0, 1}}}, .cords = {}});
  const double before = space.calc_books().calc_total();
  run(space, 2.0);
  EXPECT_TRUE(space.is_still(0));
  EXPECT_NEAR(space.state(0).centre[2], 0.05, 3e-6);
  EXPECT_NEAR(space.calc_books().calc_total(), before, 1e-4);
  EXPECT_NEAR(space.calc_books().lost_j, 0.4 * kG * 0.05, 1e-3 * 0.4 * kG * 0.05);
}

TEST(joints, friction_loss_on_floor) {
  // A bar on a universal support turns about the vertical with its end on a plate: the moment of friction stops it as it would a mass.
  const double mass = 0.5, arm = 0.3, mu = 0.3, w = 4.0;
  std::vector<Solid> solids{make_ball_solid(mass, 0.02, 0.0, mu), make_wall({1.0, 1.0, 0.1}, 0.0, mu)};
  std::vector<State> states{at({arm, 0, 0.02}), at({0, 0, -0.05})};
  states[0].velocity = {0, arm * w, 0};
  states[0].momentum = solids[0].inertia_kg_m2 * Vec3{0, 0, w};
  // The ball's arm is hinged about the vertical on a slider that carries nothing: so the plate bears the weight.
  solids.push_back(make_box_solid(1e-3, {0.01, 0.01, 0.01}));
  states.push_back(at({0, 0, 0.3}));
  Space space(std::move(solids), std::move(states), std::nullopt, kGravity, {},
              {.joints = {{.kind = joints::Kind::kSlider, .body = 2, .to = -1, .at = {}, .axis = {0, 0, 1}},
                          {.kind = joints::Kind::kHinge, .body = 0, .to = 2, .at = {0, 0, 0.02}, .axis = {0, 0, 1}}},
               .cords = {}});
  const double before = space.calc_books().calc_total(), t = 0.2;
  run(space, t);
  // The ball is kept from rolling by its hinge: it slides. I w' = -mu N R with N the weight of both.
  const double inertia = mass * arm * arm + 0.4 * mass * 0.02 * 0.02, slope = mu * (mass + 1e-3) * kG * arm / inertia;
  EXPECT_NEAR(space.placed(0).spin[2], w - slope * t, 0.01 * w);
  EXPECT_NEAR(space.calc_books().calc_total(), before, 0.01 * space.calc_books().lost_j);
}

TEST(joints, same_bits_in_any_slices) {
  const auto make = [] {
    std::vector<Solid> solids{make_ball_solid(0.5, 0.03, 0.7, 0.3), make_wall({0.1, 0.2, 0.2}, 0.7, 0.3)};
    std::vector<State> states{at({0.4 * std::sin(0.6), 0, -0.4 * std::cos(0.6)}), at({-0.08, 0, -0.4})};
    return Space(std::move(solids), std::move(states), std::nullopt, kGravity, {},
                 {.joints = {{.kind = joints::Kind::kBall, .body = 0, .to = -1, .at = {}}}, .cords = {}});
  };
  Space one = make(), two = make();
  run(one, 1.5);
  run(two, 1.5);
  EXPECT_EQ(one.state(0).centre, two.state(0).centre);
  EXPECT_EQ(one.state(0).momentum, two.state(0).momentum);
}

TEST(cords, pendulum_on_cord) {
  // Frictionless sphere that does not turn about its cord's end: it is tied at its centre, a point mass.
  const double l = 0.5, a = 0.5, mass = 0.2;
  std::vector<Solid> solids{make_ball_solid(mass, 0.02)};
  std::vector<State> states{at({l * std::sin(a), 0, -l * std::cos(a)})};
  Space space(std::move(solids), std::move(states), std::nullopt, kGravity, {},
              {.joints = {}, .cords = {{.a = 0, .b = -1, .at_a = {}, .at_b = {}, .length_m = l}}});
  double x = 1.0, y = std::cos(0.5 * a);
  while (std::abs(x - y) > 1e-15) {
    const double mean = 0.5 * (x + y);
    y = std::sqrt(x * y);
    x = mean;
  }
  const double period = 2.0 * std::numbers::pi * std::sqrt(l / kG) / x, before = space.calc_books().calc_total();
  const double swing = mass * kG * l * (1.0 - std::cos(a));
  run(space, 10 * period);
  const Vec3 c = space.state(0).centre;
  EXPECT_NEAR(std::atan2(c[0], -c[2]), a, 2e-3 * a);
  EXPECT_NEAR(norm(c), l, 2e-6);
  EXPECT_NEAR(space.calc_books().motion_j, before, 1e-3 * swing);
  EXPECT_NEAR(space.calc_books().calc_total(), before, 1e-3 * swing);
}

TEST(cords, slack_cord) {
  const double l = 0.3, mass = 0.2;
  std::vector<Solid> solids{make_ball_solid(mass, 0.02)};
  std::vector<State> states{at({0, 0, -0.1})};
  Space space(std::move(solids), std::move(states), std::nullopt, kGravity, {},
              {.joints = {}, .cords = {{.a = 0, .b = -1, .at_a = {0, 0, 0.02}, .at_b = {}, .length_m = l}}});
  const double drop = l - 0.08, t = std::sqrt(2.0 * drop / kG);
  run(space, 0.9 * t);
  EXPECT_NEAR(space.state(0).centre[2], -0.1 - 0.5 * kG * 0.81 * t * t, 1e-9);
  std::vector<Strike> strikes;
  while (space.get_time() < t + 0.5) {
    space.step(t + 0.5);
    for (Strike& s : space.take_strikes()) strikes.push_back(std::move(s));
  }
  ASSERT_FALSE(strikes.empty());
  EXPECT_NEAR(strikes.front().time_s, t, 1e-7);
  EXPECT_NEAR(norm(strikes.front().hits[0].impulse), mass * kG * t, 1e-6 * mass * kG * t);
  EXPECT_TRUE(space.is_still(0));
  EXPECT_NEAR(space.calc_books().lost_j, mass * kG * drop, 1e-6 * mass * kG * drop);
  EXPECT_NEAR(space.state(0).centre[2], -l - 0.02, 1e-7);
}

TEST(cords, rebound_of_elastic_cord) {
  const double l = 0.3, mass = 0.2, e = 0.5;
  std::vector<Solid> solids{make_ball_solid(mass, 0.02)};
  std::vector<State> states{at({0, 0, -0.1})};
  Space space(std::move(solids), std::move(states), std::nullopt, kGravity, {},
              {.joints = {}, .cords = {{.a = 0, .b = -1, .at_a = {}, .at_b = {}, .length_m = l, .restitution = e}}});
  const double t = std::sqrt(2.0 * 0.2 / kG), v = kG * t;
  run(space, t + 0.1);
  EXPECT_NEAR(space.state(0).velocity[2], e * v - kG * 0.1, 1e-5);
}

TEST(cords, bar_at_rest_on_two_cords) {
  // And turns about neither end: asleep, and each cord bears half.
  std::vector<Solid> solids{make_box_solid(0.3, {0.3, 0.03, 0.01}, 0.5, 0.4)};
  std::vector<State> states{at({0, 0, 0})};
  Space space(std::move(solids), std::move(states), std::nullopt, kGravity, {},
              {.joints = {},
               .cords = {{.a = 0, .b = -1, .at_a = {-0.08, 0, 0}, .at_b = {-0.08, 0, 0.2}, .length_m = 0.2},
                         {.a = 0, .b = -1, .at_a = {0.08, 0, 0}, .at_b = {0.08, 0, 0.2}, .length_m = 0.2}}});
  run(space, 0.5);
  EXPECT_TRUE(space.is_all_asleep());
  EXPECT_LT(norm(space.state(0).centre), 1e-7);
}

TEST(cords, momentum_of_two_balls_on_cord) {
  // A dumb-bell of a slack cord in flight: taut later, they turn about each other.
  std::vector<Solid> solids{make_ball_solid(0.1, 0.01), make_ball_solid(0.3, 0.01)};
  std::vector<State> states{at({0, 0, 0}), at({0.1, 0, 0})};
  states[0].velocity = {-1.0, 0.5, 0};
  states[1].velocity = {0.5, -0.2, 0.3};
  Space space(std::move(solids), std::move(states), std::nullopt, {}, {},
              {.joints = {}, .cords = {{.a = 0, .b = 1, .at_a = {}, .at_b = {}, .length_m = 0.2}}});
  const rigid::Momenta before = rigid::add_up(space);
  run(space, 1.0);
  const rigid::Momenta after = rigid::add_up(space);
  EXPECT_LT(norm(after.linear - before.linear), 1e-12);
  EXPECT_LT(norm(after.angular - before.angular), 1e-6 * norm(before.angular));
  EXPECT_NEAR(norm(space.state(0).centre - space.state(1).centre), 0.2, 3e-6);
}

/// The stop of a joint of body 0 to the world, whose centre is at `centre` at the start; its arm is `arm_m`.
Cord make_stop(bool turns, const Vec3& centre, const Vec3& axis, double max, bool is_lower, double restitution, double arm_m = 0.1) {
  Stop stop{.turns = turns, .at_a = -1.0 * centre, .axis = axis, .arm_m = arm_m, .max = max, .is_lower = is_lower};
  stop.lever_a = stop.lever_b = {0, 0, -1};
  return {.a = 0, .b = -1, .restitution = restitution, .stop = stop};
}

TEST(stops, rebound_of_pendulum_at_stop) {
  // Let go at 0.6 rad; the stop is before the lowest place, at it, or past it.
  const double r = 0.03, arm = 0.4, mass = 0.5, a = 0.6, e = 0.6;
  for (const double past : {-0.3, 0.0, 0.2}) {  // of the vertical
    const Vec3 centre{arm * std::sin(a), 0, -arm * std::cos(a)};
    Links links{.joints = {hinge(0, -1, {})}, .cords = {}};
    // About +y the ball, on the side of +x, falls with a positive angle.
    Cord stop = make_stop(true, centre, {0, 1, 0}, a + past, false, e);
    links.cords = {stop};
    Space space({make_ball_solid(mass, r)}, {at(centre)}, std::nullopt, kGravity, {}, links);
    const double inertia = mass * arm * arm + 0.4 * mass * r * r, gained = mass * kG * arm * (std::cos(past) - std::cos(a));
    const double before = space.calc_books().calc_total();
    const std::vector<Strike> strikes = step_to_first_strikes(space, 2.0);
    ASSERT_EQ(strikes.size(), 1u);
    const Strike& hit = strikes.front();
    const double speed = arm * std::sqrt(2.0 * gained / inertia);
    EXPECT_NEAR(norm(hit.before[0].velocity), speed, 1e-4 * speed) << past;
    EXPECT_NEAR(norm(hit.after[0].velocity), e * speed, 1e-4 * speed) << past;
    EXPECT_NEAR(hit.before[0].centre[0], -arm * std::sin(past), 1e-6) << past;
    EXPECT_NEAR(space.calc_books().calc_total(), before, 1e-6 * gained);
    // Back to the height of the remaining energy; never beyond the stop.
    double highest = -1.0, min = 1.0;
    while (space.get_time() < hit.time_s + 0.6) {
      space.step(3.0);
      highest = std::max(highest, space.state(0).centre[2]);
      min = std::min(min, space.state(0).centre[0]);
    }
    EXPECT_NEAR(mass * kG * (highest + arm * std::cos(past)), e * e * gained, 2e-3 * gained) << past;
    EXPECT_GT(min, -arm * std::sin(past) - 1e-5) << past;
  }
}

TEST(stops, rest_on_stop) {
  // A bar on a hinge at its end falls from upright and comes to lie on a stop 1 rad from there, after bounces of restitution 0.3.
  const double l = 0.3;
  const Vec3 centre{1e-3, 0, 0.5 * l};
  Links links{.joints = {hinge(0, -1, {})}, .cords = {make_stop(true, centre, {0, 1, 0}, 1.0, false, 0.3)}};
  Space space({make_box_solid(0.4, {0.02, 0.02, l})}, {at(centre)}, std::nullopt, kGravity, {}, links);
  const double before = space.calc_books().calc_total();
  run(space, 4.0);
  EXPECT_TRUE(space.is_all_asleep());
  const double angle = std::atan2(space.state(0).centre[0], space.state(0).centre[2]) - std::atan2(centre[0], centre[2]);
  EXPECT_NEAR(angle, 1.0, 1e-4);
  EXPECT_NEAR(space.calc_books().calc_total(), before, 1e-3 * std::abs(before));
}

TEST(stops, slider_between_stops) {
  // Without gravity, to and fro between two stops: the speed is e^n times the first, the times follow.
  const double e = 0.8, v = 0.5, low = -0.1, high = 0.2;
  joints::Joint slider{.kind = joints::Kind::kSlider, .body = 0, .to = -1, .at = {}, .axis = {0.6, 0, 0.8}};
  Links links{.joints = {slider},
              .cords = {make_stop(false, {}, {0.6, 0, 0.8}, low, true, e), make_stop(false, {}, {0.6, 0, 0.8}, high, false, e)}};
  State start = at({});
  start.velocity = {0.6 * v, 0, 0.8 * v};
  Space space({make_box_solid(0.4, {0.02, 0.03, 0.05})}, {start}, std::nullopt, {}, {}, links);
  std::vector<Strike> strikes;
  while (strikes.size() < 5 && space.get_time() < 10.0) {
    space.step(10.0);
    for (Strike& s : space.take_strikes()) strikes.push_back(std::move(s));
  }
  ASSERT_EQ(strikes.size(), 5u);
  double time = high / v, speed = v;
  for (const Strike& s : strikes) {
    EXPECT_NEAR(s.time_s, time, 1e-5 * time);
    EXPECT_NEAR(norm(s.after[0].velocity), e * speed, 1e-9);
    speed *= e;
    time += (high - low) / speed;
  }
}

TEST(stops, momentum_of_two_free_bars) {
  // Two bars with a hinge between them float; one turns until it strikes the stop. Restitution 1: the energy stays.
  const double l = 0.2, mass = 0.3;
  for (const double e : {1.0, 0.4}) {
    std::vector<State> states{at({0, 0, 0.5 * l}), at({0, 0, -0.5 * l})};
    const Solid bar = make_box_solid(mass, {0.02, 0.02, l});
    states[0].momentum = {0, bar.inertia_kg_m2[1][1] * 3.0, 0};
    states[0].velocity = {0.5 * l * 3.0, 0, 0};
    Stop stop{.turns = true, .at_a = {0, 0, -0.5 * l}, .at_b = {0, 0, 0.5 * l}, .axis = {0, 1, 0}, .arm_m = 0.1, .max = 0.7};
    stop.lever_a = stop.lever_b = {0, 0, 1};
    Links links{.joints = {hinge(0, 1, {})}, .cords = {{.a = 0, .b = 1, .restitution = e, .stop = stop}}};
    Space space({bar, bar}, std::move(states), std::nullopt, {}, {.joint_tolerance = 1e-11}, links);
    const auto calc_momentum = [&] { return mass * (space.state(0).velocity + space.state(1).velocity); };
    const auto calc_spin = [&] {
      Vec3 sum{};
      for (const int i : {0, 1}) sum = sum + space.state(i).momentum + mass * cross(space.state(i).centre, space.state(i).velocity);
      return sum;
    };
    const Vec3 p = calc_momentum(), m = calc_spin();
    const double before = space.calc_books().motion_j;
    const std::vector<Strike> strikes = step_to_first_strikes(space, 3.0);
    ASSERT_EQ(strikes.size(), 1u);
    const auto calc_opening = [&](const std::vector<State>& s) {  // of the hinge
      return s[0].momentum[1] / bar.inertia_kg_m2[1][1] - s[1].momentum[1] / bar.inertia_kg_m2[1][1];
    };
    EXPECT_NEAR(calc_opening(strikes[0].after), -e * calc_opening(strikes[0].before), 1e-6);
    EXPECT_LT(norm(calc_momentum() - p), 1e-6 * norm(p));
    EXPECT_LT(norm(calc_spin() - m), 1e-6 * norm(m));
    if (e == 1.0) {
      EXPECT_NEAR(space.calc_books().motion_j, before, 1e-6 * before);
    }
    EXPECT_NEAR(space.calc_books().calc_total(), before, 1e-6 * before);
  }
}

}  // namespace
}  // namespace carillon::rigid
