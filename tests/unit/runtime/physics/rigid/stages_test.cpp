// Each stage of a step by itself: against brute force, closed forms, statics and the conservation laws.
#include "tests/unit/runtime/physics/rigid/stages.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <random>

#include "runtime/physics/rigid/space.hpp"

namespace carillon::rigid {
namespace {

State make_turned(std::mt19937& random, double height_m) {
  std::normal_distribution<double> normal;
  State s = make_state({0, 0, height_m});
  for (double& q : s.rotation) q = normal(random);
  s.rotation = normalise(s.rotation);
  return s;
}

TEST(touch_sets, lowest_gap_of_all_vertices) {
  std::mt19937 random(5);
  const geometry::tests::Solid box = geometry::tests::make_box(kBoxSides, 1);
  for (int n = 0; n < 50; ++n) {
    Stages stages({make_solid(box, 0.1, kBoxSides)}, {make_turned(random, 0.0)}, kWood, {0, 0, -kGravity});
    const auto find_lowest = [&] {
      double lowest = 1.0;
      const State& s = stages.bodies.state(0);
      for (const Vec3& x : box.vertices) lowest = std::min(lowest, (s.centre + make_rotation(s.rotation) * x)[2]);
      return lowest;
    };
    stages.bodies.state(0).centre[2] = 1e-4 - find_lowest();
    stages.bodies.place(0);
    stages.begin({{0, -1}});
    const auto find_gap = [&] {
      double gap = 1.0;
      for (const Contact& c : stages.island.pairs[0]->contacts) gap = std::min(gap, c.touch.gap_m);
      return gap;
    };
    EXPECT_NEAR(find_gap(), find_lowest(), 1e-12);
    // A small step later the same touches are followed.
    State& s = stages.bodies.state(0);
    s.centre[2] -= 5e-5;
    s.rotation = normalise(multiply(make_turn({1e-6, 2e-6, 0}), s.rotation));
    stages.bodies.place(0);
    stages.touches.refresh(*stages.island.pairs[0]);
    EXPECT_NEAR(find_gap(), find_lowest(), 1e-12);
  }
}

TEST(touch_sets, persistent_contact) {
  Stages stages({make_box(0.1, kBoxSides)}, {make_state({0, 0, 0.02})}, kWood, {0, 0, -kGravity});
  stages.begin({{0, -1}});
  Pair& pair = *stages.island.pairs[0];
  ASSERT_EQ(pair.contacts.size(), 4u);
  for (Contact& c : pair.contacts) c.impulse = c.touch.where_m;
  stages.bodies.state(0).centre[0] += 1e-5;
  stages.bodies.place(0);
  stages.touches.search(pair, 1e-3);
  ASSERT_EQ(pair.contacts.size(), 4u);
  for (const Contact& c : pair.contacts) EXPECT_LT(norm(c.impulse - c.touch.where_m), 1.01e-5);
}

TEST(touch_sets, contact_side_of_deep_body) {
  // Past the middle plane of a shelf of 4 mm, which springs and modes explain. Depth: that of the lowest vertex below the upper side.
  const Vec3 sides{0.3, 0.3, 0.004};
  const geometry::tests::Solid lumpy = geometry::tests::make_lumpy(0.025, 16);
  std::mt19937 random(3);
  for (int n = 0; n < 20; ++n) {
    Solid shelf = make_solid(geometry::tests::make_box(sides, 12), 1.0, sides);
    shelf.fixed = true;
    Stages stages({make_solid(lumpy, 0.5, {0.04, 0.04, 0.04}), std::move(shelf)}, {make_turned(random, 0.0), make_state({})}, std::nullopt,
                  {0, 0, -kGravity});
    const double depth_m = 2.2e-3 + 5e-4 * n;
    Mat3 turned = make_rotation(stages.bodies.state(0).rotation);
    double lowest_m = 1.0;
    for (const Vec3& x : lumpy.vertices) lowest_m = std::min(lowest_m, (turned * x)[2]);
    stages.bodies.state(0).centre[2] = 0.5 * sides[2] - depth_m - lowest_m;
    stages.bodies.place(0);
    Pair& pair = stages.touches.get(0, 1);
    stages.touches.part(pair, depth_m, {0, 0, 1});
    stages.begin({{0, 1}});
    const auto expect = [&](double deep_m) {
      ASSERT_FALSE(pair.contacts.empty());
      double least_m = 1.0;
      for (const Contact& c : pair.contacts) {
        EXPECT_GT(c.touch.normal[2], 0.99) << n;
        least_m = std::min(least_m, c.touch.gap_m);
      }
      EXPECT_NEAR(least_m, -deep_m, 1e-4) << n;
    };
    expect(depth_m);
    stages.bodies.state(0).centre[2] -= 1e-5;
    stages.bodies.place(0);
    stages.touches.refresh(pair);
    expect(depth_m + 1e-5);
  }
}

TEST(touch_sets, loss_of_unused_spring_energy) {
  Stages stages({make_box(0.1, kBoxSides), make_box(0.1, kBoxSides)}, {make_state({0, 0, 0.02}), make_state({1, 0, 0.02})}, kWood,
                {0, 0, -kGravity});
  stages.begin({{0, -1}, {1, -1}});
  const double total_j = stages.calc_books().calc_total();
  const auto expect = [&](double springs_j, double lost_j) {
    const Books books = stages.calc_books();
    EXPECT_EQ(books.springs_j, springs_j);
    EXPECT_EQ(books.lost_j, lost_j);
  };
  stages.touches.release(0, -1, 1e-4, 1.0);
  stages.touches.release(1, -1, 1e-4, 2.0);
  stages.touches.release(0, 1, 1e-4, 4.0);  // of a pair that is not followed
  expect(3.0, 4.0);
  stages.touches.travel(stages.touches.get(0, -1), 1e-3, 1e-3);  // still deep
  expect(3.0, 4.0);
  stages.touches.travel(stages.touches.get(0, -1), 0.1, 1e-3);
  expect(2.0, 5.0);
  stages.touches.get(0, -1).window = 7;
  stages.touches.forget_far(7);
  expect(0.0, 7.0);
  EXPECT_EQ(stages.calc_books().calc_total(), total_j + 7.0);
}

TEST(step_problem, block_on_slope) {
  const double h = 5e-4, mass = 0.1;
  for (const double slope : {0.0, 0.2, 0.35, 0.5}) {  // friction 0.4 holds up to 0.3805 rad
    Stages stages({make_box(mass, kBoxSides)}, {make_state({0, 0, 0.02})}, kWood,
                  {kGravity * std::sin(slope), 0, -kGravity * std::cos(slope)});
    stages.begin({{0, -1}});
    for (Contact& c : stages.island.pairs[0]->contacts) c.touching = true;
    stages.solve(h);
    const double slides = std::max(0.0, std::sin(slope) - 0.4 * std::cos(slope)) * kGravity;
    const Vec3 sum = stages.sum_impulses(), &velocity = stages.step.movers[0].velocity;
    EXPECT_NEAR(velocity[0], slides * h, 1e-12);
    EXPECT_NEAR(velocity[2], 0.0, 1e-12);
    EXPECT_NEAR(sum[2], mass * kGravity * std::cos(slope) * h, 1e-14);
    EXPECT_NEAR(sum[0], mass * (slides - kGravity * std::sin(slope)) * h, 1e-14);
    EXPECT_EQ(stages.problem.solve_rest(stages.step, h, {}, 0.0), slides == 0.0);
  }
}

TEST(instants, slow_touches_of_rattling_pair) {
  for (const bool decays : {false, true}) {
    Stages stages({make_box(0.1, kBoxSides)}, {make_state({0, 0, 0.02 + 1e-6}, {0, 0, -0.02})}, kWood, {0, 0, -kGravity});
    stages.begin({{0, -1}});
    Pair& pair = *stages.island.pairs[0];
    const std::vector<ContactRef> struck{{&pair, 0}};
    const auto strikes = [&] { return is_fast(stages.bodies, pair, pair.contacts[0], 1e-3); };
    double speed = 0.04;
    for (int n = 0; n < 5; ++n) {
      stages.bodies.set_time(1e-3 * n);
      EXPECT_TRUE(strikes()) << n;
      stages.instants.note(struck, {{.a = 0, .b = -1, .touch = pair.contacts[0].touch, .approach_m_s = speed}}, stages.bodies.get_time());
      if (decays) speed *= stages.bodies.calc_restitution(0, -1);
    }
    EXPECT_EQ(strikes(), decays) << "a bounce that comes to rest is no rattle";
    stages.bodies.state(0).velocity = {0, 0, -0.1};
    EXPECT_TRUE(strikes());
    stages.bodies.state(0).velocity = {0, 0, -0.02};
    stages.bodies.set_time(0.07);
    EXPECT_TRUE(strikes()) << "it rattles no longer";
  }
}

TEST(instants, instant_of_fall) {
  const double gap = 2e-5, speed = 0.1, h = 5e-4;
  Stages stages({make_box(0.1, kBoxSides)}, {make_state({0, 0, 0.02 + gap}, {0, 0, -speed})}, kWood, {0, 0, -kGravity});
  stages.begin({{0, -1}});
  stages.solve(h, true);
  EXPECT_TRUE(stages.step.points.empty());
  double at = 0.0;
  std::vector<ContactRef> first;
  ASSERT_TRUE(stages.instants.find(stages.step, at, first));
  EXPECT_EQ(first.size(), 4u);
  EXPECT_NEAR(at, (std::sqrt(speed * speed + 2.0 * kGravity * gap) - speed) / kGravity, 1e-9 / speed);
  // Parting bodies strike nothing.
  stages.bodies.state(0).velocity = {0, 0, speed};
  stages.bodies.place(0);
  stages.solve(h, true);
  first.clear();
  EXPECT_FALSE(stages.instants.find(stages.step, at, first));
}

/// Two boxes of different mass, one of which strikes a corner region of the other along x.
struct Boxes {
  Solid a = make_box(0.1, kBoxSides), b = make_box(0.3, kBoxSides);
  double speed = 2.0;
  Contact contact;

  Boxes() {
    a.friction = b.friction = 0.0;
    a.restitution = 0.9;
    b.restitution = 0.4;
    contact.a = 0;
    contact.b = 1;
    contact.touch.where_m = contact.touch.station_a = {0.03, 0.02, 0.01};
    contact.touch.station_b = {-0.03, 0.02, 0.01};
    contact.touch.normal = {-1, 0, 0};
  }
  Stages make() const { return Stages({a, b}, {make_state({}, {speed, 0, 0}), make_state({0.06, 0, 0})}, std::nullopt, {}); }
  double calc_mass() const {
    double inverse = 0.0;
    for (const Solid* s : {&a, &b}) {
      const Vec3 arm = cross(Vec3{s == &a ? 0.03 : -0.03, 0.02, 0.01}, Vec3{1, 0, 0});
      inverse += 1.0 / s->mass_kg + dot(arm, s->inverse_inertia * arm);
    }
    return 1.0 / inverse;
  }
};

TEST(rigid_impact, blow_through_row_of_balls) {
  const double radius = 0.02;
  const geometry::tests::Solid surface = geometry::tests::make_ball(radius, 3);
  const double pitch = 2 * radius - 7.46e-5;  // faces touch there
  for (const double e : {1.0, 0.95})
    for (const int struck : {1, 2}) {
      std::vector<Solid> balls;
      std::vector<State> states;
      for (int i = 0; i < 5; ++i) {
        balls.push_back(make_solid(surface, 0.1, {2 * radius, 2 * radius, 2 * radius}));
        balls.back().restitution = e;
        balls.back().friction = 0.0;
        states.push_back(make_state({pitch * i + (i < struck ? -1e-3 : 0.0), 0, 0}, {i < struck ? 1.0 : 0.0, 0, 0}));
      }
      Space space(balls, states, std::nullopt, {}, {});
      while (space.get_time() < 0.01) space.step(0.01);
      double momentum = 0.0, kinetic = 0.0;
      for (int i = 0; i < 5; ++i) {
        const double v = space.state(i).velocity[0];
        momentum += v;
        kinetic += v * v;
        if (e == 1.0) {
          EXPECT_NEAR(v, i < 5 - struck ? 0.0 : 1.0, 1e-3) << struck << " struck, ball " << i;
        }
      }
      EXPECT_NEAR(momentum, struck, 1e-9);
      EXPECT_LE(kinetic, struck + 1e-9);
      EXPECT_GT(space.state(4).velocity[0], std::pow(0.5 * (1.0 + e), 4.0) - 1e-3);
    }
}

TEST(rigid_impact, oblique_hit) {
  const Boxes boxes;
  Stages stages = boxes.make();
  Pair pair;
  pair.a = 0;
  pair.b = 1;
  pair.contacts.push_back(boxes.contact);
  stages.begin({});
  stages.island.pairs.push_back(&pair);
  Collision collision = stages.rigid_impact.make(stages.step, stages.rigid_impact.gather(stages.step, {{&pair, 0}}));
  stages.rigid_impact.solve(collision);
  double lost_j = 0.0;
  const Strike strike = stages.rigid_impact.apply(collision, lost_j);
  const double e = std::sqrt(0.9 * 0.4), mass = boxes.calc_mass();
  ASSERT_EQ(strike.hits.size(), 1u);
  EXPECT_NEAR(strike.hits[0].impulse[0], -(1.0 + e) * mass * boxes.speed, 1e-9);
  EXPECT_NEAR(lost_j, 0.5 * mass * boxes.speed * boxes.speed * (1.0 - e * e), 1e-9);
  EXPECT_NEAR(stages.bodies.calc_approach(boxes.contact.touch, 0, 1), -e * boxes.speed, 1e-9);
  Vec3 linear{}, angular{};
  for (int i = 0; i < 2; ++i) {
    const State& s = stages.bodies.state(i);
    const Vec3 p = stages.bodies.solid(i).mass_kg * s.velocity;
    linear = linear + p;
    angular = angular + cross(s.centre, p) + s.momentum;
  }
  EXPECT_LT(norm(linear - Vec3{0.1 * boxes.speed, 0, 0}), 1e-15);
  EXPECT_LT(norm(angular), 1e-16);
}

/// The second box rings: one mode, which moves all of its surface along x.
Solid make_ringing(Solid solid, double freq_hz, double decay_per_s) {
  solid.modes = std::make_shared<impact::Modes>(std::vector{2.0 * std::acos(-1.0) * freq_hz}, std::vector{decay_per_s});
  const double phi = 1.0 / std::sqrt(solid.mass_kg);
  solid.find_shape = [phi](const geometry::Place&) { return std::vector{phi, 0.0, 0.0}; };
  return solid;
}

TEST(modal_impact, momentum_and_energy_balance) {
  Boxes boxes;
  boxes.b = make_ringing(boxes.b, 2e3, 10.0);
  boxes.a.restitution = boxes.b.restitution = 1.0;
  Stages stages = boxes.make();
  Pair& pair = stages.touches.get(0, 1);
  pair.contacts.push_back(boxes.contact);
  pair.searched = true;
  stages.begin({});
  stages.island.pairs.push_back(&pair);
  const double start_j = stages.calc_books().motion_j;
  Collision collision = stages.rigid_impact.make(stages.step, {{&pair, 0}});
  ASSERT_TRUE(stages.modal_impacts.predict(stages.step, collision));
  EXPECT_LT(collision.hits[0].restitution, 0.95);
  ASSERT_TRUE(stages.modal_impacts.begin(stages.step, collision, stages.instants, stages.touches));
  EXPECT_TRUE(pair.contacts[0].presses);
  EXPECT_TRUE(stages.modal_impacts.is_pressed(pair, boxes.contact.touch.where_m));
  const double h = 1e-5;
  double time_s = 0.0, springs_j = 0.0;
  while (!stages.modal_impacts.list().empty() && time_s < 0.01) {
    stages.solve(h);
    time_s += h;
    stages.modal_impacts.advance(stages.step, time_s, h, 2e-3, stages.touches);
    for (const int body : {0, 1}) stages.bodies.place(body);
    stages.bodies.set_time(time_s);
    const Books books = stages.calc_books();
    springs_j = std::max(springs_j, books.springs_j);
    EXPECT_NEAR(books.calc_total(), start_j, 1e-6 * start_j);
  }
  EXPECT_LT(time_s, 1e-3);
  EXPECT_GT(springs_j, 0.1 * start_j);
  EXPECT_GT(stages.calc_books().modes_j, 0.02 * start_j);
  EXPECT_FALSE(pair.contacts[0].presses);
  Vec3 linear{}, pushed{};
  for (int i = 0; i < 2; ++i) linear = linear + stages.bodies.solid(i).mass_kg * stages.bodies.state(i).velocity;
  EXPECT_LT(norm(linear - Vec3{0.1 * boxes.speed, 0, 0}), 1e-12);
  for (const Forces& forces : stages.modal_impacts.take_forces())
    for (const Vec3& impulse : forces.on_a) pushed = pushed + impulse;
  EXPECT_NEAR(pushed[0], 0.1 * (stages.bodies.state(0).velocity[0] - boxes.speed), 1e-6);
}

TEST(modal_impact, punch_stiffness_of_soft_face) {
  // Half a period of a mass on k = 2 E* sqrt(A / pi), the stiffness of a flat punch: depth v sqrt(m / k). On Hertz springs at its corners
  // it is six times as deep.
  const Vec3 sides{0.1, 0.08, 0.04};
  const double mass = 0.35, speed = 0.5, young = 1e7, poisson = 0.45;
  Solid box = make_box(mass, sides);
  box.restitution = 1.0;
  box.friction = 0.0;
  box.young_modulus_pa = young;
  box.poisson_ratio = poisson;
  box.modes = std::make_shared<impact::Modes>(std::vector{2.0 * std::acos(-1.0) * 50.0}, std::vector{10.0});
  const double phi = 0.2 / std::sqrt(mass);
  box.find_shape = [phi](const geometry::Place&) { return std::vector{0.0, 0.0, phi}; };
  const Ground ground{.restitution = 1.0, .friction = 0.0, .young_modulus_pa = 1e13, .poisson_ratio = 0.3};
  Space space({box}, {make_state({0, 0, 0.5 * sides[2] + 1e-4}, {0, 0, -speed})}, ground, {}, {});
  double deepest_m = 0.0;
  while (space.get_time() < 0.03) {
    space.step(0.03);
    deepest_m = std::max(deepest_m, 0.5 * sides[2] - space.state(0).centre[2]);
  }
  const double stiffness = 2.0 * young / (1.0 - poisson * poisson) * std::sqrt(sides[0] * sides[1] / std::acos(-1.0));
  EXPECT_NEAR(deepest_m, speed * std::sqrt(mass / stiffness), 0.1 * deepest_m);
  EXPECT_GT(space.state(0).velocity[2], 0.8 * speed);
  EXPECT_LT(space.get_costs().impacts, 3);
}

TEST(ledger, booked_modal_damping) {
  const double decay = 50.0;
  Stages stages({make_ringing(make_box(0.1, kBoxSides), 1e3, decay)}, {make_state({0, 0, 1}, {0, 0, 2})}, std::nullopt, {0, 0, -kGravity});
  stages.modal_states.set(0, {{0.0}, {0.3}, 0.0});
  EXPECT_NEAR(stages.calc_books().motion_j, 0.1 * (0.5 * 4 + kGravity), 1e-14);
  EXPECT_NEAR(stages.calc_books().modes_j, 0.5 * 0.09, 1e-15);
  stages.bodies.set_time(0.02);
  const Books asked = stages.calc_books();  // asking moves nothing
  stages.modal_states.advance(0, 0.02);
  const Books books = stages.calc_books();
  EXPECT_DOUBLE_EQ(books.modes_j, asked.modes_j);
  EXPECT_DOUBLE_EQ(books.lost_j, asked.lost_j);
  EXPECT_NEAR(books.modes_j + books.lost_j, 0.5 * 0.09, 1e-15);
  EXPECT_NEAR(books.modes_j / (0.5 * 0.09), std::exp(-2.0 * decay * 0.02), 0.02);
}

TEST(ledger, bound_of_modal_energy) {
  Boxes boxes;
  boxes.a = make_ringing(boxes.a, 1e3, 0.0);
  Stages stages = boxes.make();
  Strike strike;
  strike.hits.push_back({.a = 0, .b = 1, .touch = boxes.contact.touch, .approach_m_s = 1.0, .restitution = 0.5, .impulse = {-0.1, 0, 0}});
  // The pulse is short against the period: the mode gets all of phi J.
  const double all_j = 0.5 * 0.1 * 0.1 / boxes.a.mass_kg;
  stages.modal_states.excite(strike, 2.0 * all_j);
  const Books books = stages.calc_books();
  EXPECT_NEAR(books.modes_j, all_j, 0.1 * all_j);
  EXPECT_DOUBLE_EQ(strike.modes_j, books.modes_j);
  EXPECT_EQ(stages.modal_states.advance(0, 0.0).time_s, strike.time_s);  // an impact that begins now finds them now
  EXPECT_NEAR(books.modes_j + books.lost_j, 2.0 * all_j, 1e-15);
  // Of a motion that lost next to nothing they get nothing.
  stages.modal_states.excite(strike, 1e-3 * all_j);
  EXPECT_EQ(strike.modes_j, 0.0);
  EXPECT_DOUBLE_EQ(stages.calc_books().modes_j, books.modes_j);
  EXPECT_NEAR(stages.calc_books().lost_j, books.lost_j + 1e-3 * all_j, 1e-15);
}

TEST(windows, flights_and_independent_steps) {
  std::vector<Solid> solids{make_box(0.1, kBoxSides), make_box(0.1, kBoxSides), make_box(0.1, kBoxSides), make_box(0.1, kBoxSides)};
  std::vector<State> states{make_state({0, 0, 1}, {1, 0, 0}), make_state({1, 0, 0.0201}), make_state({2, 0, 0.021}, {0, 0, -30}),
                            make_state({3, 0, 1})};
  solids[3].fixed = true;
  Stages stages(solids, states, kWood, {0, 0, -kGravity});
  stages.windows.open(1.0, {});
  const std::vector<Pair*>& near = stages.windows.near();
  ASSERT_EQ(near.size(), 2u);
  for (const int n : {0, 1}) EXPECT_EQ(std::pair(near[n]->a, near[n]->b), std::pair(n + 1, -1));
  EXPECT_EQ(stages.windows.fly_bodies(), std::vector{0});
  const double t = Windows::kLength;
  EXPECT_LT(norm(stages.bodies.state(0).centre - Vec3{t, 0, 1 - 0.5 * kGravity * t * t}), 1e-15);
  stages.windows.choose_steps();
  EXPECT_EQ(stages.windows.count_islands(), 3);
  for (Pair* pair : near) stages.touches.search(*pair, 1e-3);
  const std::vector<Island> islands = stages.windows.make_islands({});
  ASSERT_EQ(islands.size(), 2u);
  EXPECT_GT(islands[0].stride, islands[1].stride);  // the second is fast
  EXPECT_EQ(stages.windows.calc_length(islands[0].stride), 2.0 * stages.options.step_s);
  // An impact that throws the slow one towards the one that flies takes its flight back.
  stages.bodies.state(1).velocity = {-600, 0, 600};
  stages.bodies.place(1);
  stages.windows.extend(1, 0.0);
  EXPECT_LT(stages.bodies.state(0).centre[0], t);
  EXPECT_EQ(near.size(), 4u);
}

TEST(rest, sleep_and_wake_of_balanced_island) {
  for (const double slope : {0.2, 0.5}) {
    Stages stages({make_box(0.1, kBoxSides), make_box(0.1, kBoxSides), make_box(0.1, kBoxSides)},
                  {make_state({0, 0, 0.02}), make_state({0, 0, 0.06}), make_state({0, 0, 0.1}, {0, 0, -1})}, kWood,
                  {kGravity * std::sin(slope), 0, -kGravity * std::cos(slope)});
    Island tower{{0, 1}, {&stages.touches.get(0, -1), &stages.touches.get(0, 1)}}, third{{2}, {&stages.touches.get(1, 2)}};
    for (const Island* island : {&tower, &third})
      for (Pair* pair : island->pairs) stages.touches.search(*pair, 1e-3);
    EXPECT_FALSE(stages.rest.may_sleep(tower.bodies, 0.015));  // not slow for long
    EXPECT_TRUE(stages.rest.may_sleep(tower.bodies, 0.015));
    EXPECT_EQ(stages.rest.try_island(tower, 5e-4), slope < 0.3);
    if (slope > 0.3) continue;
    EXPECT_TRUE(stages.bodies.is_asleep(0) && stages.bodies.is_asleep(1));
    Vec3 carried{};
    for (const Contact& c : tower.pairs[0]->contacts) carried = carried + c.rest_n;
    EXPECT_NEAR(carried[2], 0.2 * kGravity * std::cos(slope), 1e-6);
    stages.step.begin(third);
    EXPECT_TRUE(stages.rest.wake_struck(stages.step, {{third.pairs[0], 0}}));
    EXPECT_EQ(third.bodies, (std::vector{2, 1}));
    EXPECT_TRUE(stages.bodies.is_asleep(0) && stages.bodies.moves(1));
    EXPECT_FALSE(stages.rest.wake_struck(stages.step, {{third.pairs[0], 0}}));
  }
}

// A box on a slope too steep for its friction has no balance. Kept in place nevertheless it sleeps after 0.3 s, and after 0.1 s once woken;
// not if it moves 60 um within that time, is not carried by a contact, or is too deep.
TEST(rest, sleep_of_island_that_stays_in_place) {
  enum Case { stays, moves, turns, is_open, is_deep };
  for (const Case now : {stays, moves, turns, is_open, is_deep}) {
    Stages stages({make_box(0.1, kBoxSides)}, {make_state({0, 0, 0.02})}, kWood, {kGravity * std::sin(0.5), 0, -kGravity * std::cos(0.5)});
    stages.begin({{0, -1}});
    for (Contact& c : stages.island.pairs[0]->contacts) {
      c.touching = now != is_open;
      c.step_s = 5e-4;
      c.impulse = {0, 0, 1e-4};
      if (now == is_deep) c.touch.gap_m = -3e-5;
    }
    State& s = stages.bodies.state(0);
    const auto sleeps = [&] {
      stages.rest.note_still();
      return stages.rest.try_still(stages.island, 5e-4);
    };
    for (int window = 0; window < 150; ++window) {
      stages.bodies.set_time(2e-3 * window);
      ASSERT_FALSE(sleeps()) << now;
      if (now == moves) s.centre[0] += 6e-5 / 150;
      if (now == turns) s.rotation = normalise(multiply(make_turn({0, 0, 6e-5 / 150 / stages.bodies.solid(0).radius_m}), s.rotation));
      stages.bodies.place(0);
    }
    stages.bodies.set_time(0.302);
    s.velocity = {1e-3, 0, 0};
    const Books before = stages.calc_books();
    ASSERT_EQ(sleeps(), now == stays) << now;
    EXPECT_NEAR(stages.calc_books().calc_total(), before.calc_total(), 1e-18);
    if (now != stays) continue;
    EXPECT_TRUE(stages.bodies.is_asleep(0));
    EXPECT_EQ(s.velocity, Vec3{});
    stages.rest.wake(0);
    EXPECT_FALSE(sleeps());
    stages.bodies.set_time(0.4);
    EXPECT_FALSE(sleeps());
    stages.bodies.set_time(0.404);
    EXPECT_TRUE(sleeps());
  }
}

TEST(rest, recovery_before_sleep) {
  Stages stages({make_box(0.1, kBoxSides)}, {make_state({0, 0, 0.02 - 1e-4})}, kWood, {0, 0, -kGravity});
  stages.begin({{0, -1}});
  double& sag_m = stages.island.pairs[0]->sag_m = 1e-4;
  EXPECT_FALSE(stages.rest.may_sleep(stages.island.bodies, 0.015));
  EXPECT_TRUE(stages.rest.may_sleep(stages.island.bodies, 0.015));
  EXPECT_FALSE(stages.rest.try_island(stages.island, 5e-4));
  sag_m = 0.0;
  stages.projection.run(stages.step, kDeepM, 0.0);
  EXPECT_TRUE(stages.rest.try_island(stages.island, 5e-4));
  EXPECT_NEAR(stages.bodies.state(0).centre[2], 0.02, kDeepM);
}

}  // namespace
}  // namespace carillon::rigid
