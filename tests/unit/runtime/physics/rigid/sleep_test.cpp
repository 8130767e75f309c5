// Sleeping parts of moving groups, and their wake-up. Oracle: the same bodies in one problem, in which none sleeps alone.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <utility>
#include <vector>

#include "runtime/physics/rigid/space.hpp"
#include "tests/unit/runtime/physics/rigid/bodies.hpp"
#include "tests/unit/runtime/physics/rigid/drops.hpp"

namespace carillon::rigid {
namespace {

const Vec3 kSides{0.06, 0.05, 0.04};

/// A scene that can be begun again and again.
struct Table {
  std::vector<Solid> solids;
  std::vector<State> states;

  int add(Solid solid, const Vec3& centre, const Vec3& velocity = {}) {
    State s;
    s.centre = centre;
    s.velocity = velocity;
    solids.push_back(std::move(solid));
    states.push_back(s);
    return static_cast<int>(solids.size()) - 1;
  }
  /// Two fixed blocks, 0.1 m high, for a board.
  void add_supports(double height_m) {
    for (const double x : {-0.4, 0.0}) {
      Solid support = make_box(1.0, {0.04, 0.2, 0.1});
      support.fixed = true;
      add(std::move(support), {x, 0, height_m});
    }
  }
  Space begin(bool islands = true) const {
    const Ground ground{.restitution = 0.2, .friction = 0.4, .young_modulus_pa = 10e9, .poisson_ratio = 0.3};
    Options options;
    options.islands = islands;
    return Space(solids, states, ground, {0, 0, -9.81}, options);
  }
};

void move(Space& space, double until_s) {
  while (space.get_time() < until_s - 1e-9) space.step(until_s);
}

Solid make_smooth_box(double mass_kg) {
  Solid box = make_box(mass_kg, kSides);
  box.friction = 0.0;
  return box;
}

TEST(sleep, sleep_among_moving_bodies) {
  // A board with twelve boxes, along which another one slides.
  Table table;
  const int board = table.add(make_box(5.0, {2.0, 0.6, 0.02}), {0, 0, 0.01});
  const int slider = table.add(make_smooth_box(0.1), {-0.8, 0.2, 0.04}, {0.5, 0, 0});
  std::vector<int> boxes;
  for (int i = 0; i < 12; ++i) boxes.push_back(table.add(make_box(0.1, kSides), {-0.8 + 0.14 * i, -0.1, 0.04}));
  Space space = table.begin();
  const double before_j = space.calc_books().motion_j;
  move(space, 0.2);
  const std::int64_t begun = space.get_costs().body_steps, steps = space.get_costs().steps;
  move(space, 2.0);
  int still = 0;
  for (const int box : boxes) {
    still += space.is_still(box) ? 1 : 0;
    EXPECT_LT(norm(space.state(box).centre - table.states[box].centre), 1e-6) << box;
  }
  EXPECT_GE(still, 8) << "what slides may have woken some a moment ago";
  EXPECT_FALSE(space.is_still(slider));
  EXPECT_FALSE(space.is_still(board)) << "what moves is on it";
  EXPECT_NEAR(space.state(slider).centre[0], 0.2, 1e-5);
  EXPECT_LT(space.get_costs().body_steps - begun, 3 * (space.get_costs().steps - steps)) << "14 bodies, of which two move";
  const Books after = space.calc_books();
  EXPECT_NEAR(after.calc_total(), before_j, 1e-8 * before_j);
}

TEST(sleep, wake_on_tipping_support) {
  // A board on two supports; a block that slides beyond the second one tips it, and wakes the box on its other end.
  Table table;
  table.add_supports(0.05);
  table.add(make_box(1.0, {1.0, 0.2, 0.02}), {0, 0, 0.11});
  const int box = table.add(make_box(0.1, kSides), {-0.3, 0, 0.14});
  table.add(make_smooth_box(1.0), {-0.1, 0, 0.14}, {0.5, 0, 0});
  Space space = table.begin(), whole = table.begin(false);
  int slept = 0;  // steps
  while (space.get_time() < 0.25) {
    space.step(0.25);
    slept += space.is_still(box) ? 1 : 0;
  }
  EXPECT_GT(slept, 20);
  move(space, 0.55);
  move(whole, 0.55);
  EXPECT_FALSE(space.is_still(box));
  EXPECT_GT(whole.state(box).centre[2], 0.15) << "it went up with the board";
  for (std::size_t i = 2; i < table.solids.size(); ++i)
    EXPECT_LT(norm(space.state(static_cast<int>(i)).centre - whole.state(static_cast<int>(i)).centre), 5e-4) << i;
}

TEST(sleep, wake_on_sinking_support) {
  // The same board; the box sleeps on the end that goes down.
  Table table;
  table.add_supports(0.35);
  table.add(make_box(1.0, {1.0, 0.2, 0.02}), {0, 0, 0.41});
  const int box = table.add(make_box(0.1, kSides), {0.25, -0.05, 0.44});
  table.add(make_smooth_box(1.0), {-0.1, 0.05, 0.44}, {0.5, 0, 0});
  Space space = table.begin(), whole = table.begin(false);
  const double before_j = space.calc_books().motion_j;
  move(space, 0.2);
  EXPECT_TRUE(space.is_still(box));
  move(space, 0.6);
  move(whole, 0.6);
  EXPECT_LT(whole.state(box).centre[2], 0.43) << "it went down with the board";
  EXPECT_NEAR(space.state(box).centre[2], whole.state(box).centre[2], 1e-3);
  const Books after = space.calc_books();
  EXPECT_NEAR(after.calc_total(), before_j, 1e-8 * before_j);
}

TEST(sleep, no_lift_of_relieved_columns) {
  // A board on two columns of two blocks; a block slides along it from one column to the other.
  Table table;
  std::vector<int> blocks;
  for (const double x : {-0.3, 0.3})
    for (const double z : {0.025, 0.075}) blocks.push_back(table.add(make_box(0.2, {0.06, 0.1, 0.05}), {x, 0, z}));
  const int board = table.add(make_box(0.5, {0.8, 0.1, 0.02}), {0, 0, 0.11});
  const int slider = table.add(make_smooth_box(1.0), {-0.28, 0, 0.14}, {0.25, 0, 0});
  Space space = table.begin(), whole = table.begin(false);
  const double before_j = space.calc_books().motion_j;
  double highest = 0.0;
  while (space.get_time() < 2.2) {
    space.step(2.2);
    highest = std::max(highest, space.state(board).centre[2] - 0.11);
  }
  move(whole, 2.2);
  EXPECT_LT(highest, 2e-6);
  for (const int block : blocks) EXPECT_LT(norm(space.state(block).centre - whole.state(block).centre), 1e-5) << block;
  EXPECT_NEAR(space.state(slider).centre[0], whole.state(slider).centre[0], 1e-3);
  const Books after = space.calc_books();
  EXPECT_NEAR(after.calc_total(), before_j, 1e-8 * before_j);
}

TEST(sleep, sleeping_row_in_impact) {
  // Three boxes in touch sleep on a board; a fourth one slides into them.
  Table table;
  table.add(make_box(5.0, {2.0, 0.6, 0.02}), {0, 0, 0.01});
  for (int i = 0; i < 3; ++i) table.add(make_smooth_box(0.1), {0.06 * i, 0, 0.04});
  const int striker = table.add(make_smooth_box(0.1), {-0.26, 0, 0.04}, {0.5, 0, 0});
  Space space = table.begin(), whole = table.begin(false);
  move(space, 0.39);
  for (int i = 1; i <= 3; ++i) EXPECT_TRUE(space.is_still(i)) << i;
  move(space, 0.45);
  move(whole, 0.45);
  double momentum = 0.0;
  for (int i = 1; i <= striker; ++i) {
    momentum += 0.1 * space.state(i).velocity[0];
    EXPECT_NEAR(space.state(i).velocity[0], whole.state(i).velocity[0], 5e-3) << i;
  }
  EXPECT_NEAR(momentum, 0.05, 1e-6) << "nothing else is pushed along";
}

/// A board on which something slides lies on two blocks. A box that touches one of these is struck.
struct StruckBlock {
  Table table;
  int struck, carrier, other, slider, striker;

  explicit StruckBlock(double gap_m, double speed_m_s) {
    struck = table.add(make_smooth_box(0.1), {-0.06, 0, 0.02});
    carrier = table.add(make_smooth_box(1.0), {0, 0, 0.02});
    other = table.add(make_smooth_box(1.0), {0.8, 0, 0.02});
    Solid board = make_box(0.2, {0.86, 0.05, 0.04});
    board.friction = 0.0;
    table.add(std::move(board), {0.425, 0, 0.06});
    slider = table.add(make_smooth_box(0.02), {0.1, 0, 0.1}, {0.25, 0, 0});
    striker = table.add(make_smooth_box(0.1), {-0.12 - gap_m, 0, 0.02}, {speed_m_s, 0, 0});
  }
  double calc_momentum(const Space& space) const {
    double sum = 0.0;
    for (std::size_t i = 0; i < table.solids.size(); ++i) sum += table.solids[i].mass_kg * space.state(static_cast<int>(i)).velocity[0];
    return sum;
  }
  void expect_asleep(const Space& space) const {
    for (const int body : {struck, carrier, other}) EXPECT_TRUE(space.is_still(body)) << body;
    EXPECT_FALSE(space.is_still(slider));
  }
};

TEST(sleep, impact_through_body_of_other_group) {
  const StruckBlock scene(0.28, 0.5);
  Space space = scene.table.begin(), whole = scene.table.begin(false);
  const double before_j = space.calc_books().motion_j;
  move(space, 0.55);
  scene.expect_asleep(space);
  const double momentum = scene.calc_momentum(space);
  move(space, 0.6);
  move(whole, 0.6);
  EXPECT_NEAR(scene.calc_momentum(space), momentum, 1e-4 * momentum);
  for (const int body : {scene.struck, scene.carrier, scene.striker, scene.slider})
    EXPECT_NEAR(space.state(body).velocity[0], whole.state(body).velocity[0], 1e-3) << body;
  const Books after = space.calc_books();
  EXPECT_NEAR(after.calc_total(), before_j, 1e-8 * before_j);
}

TEST(sleep, impact_between_groups_of_different_steps) {
  // Fast bodies take shorter steps than slowly sliding ones; the impact comes at any moment of the longer steps.
  const double speed = 40.0;
  for (int k = 0; k < 9; ++k) {
    const StruckBlock scene(speed * (0.552 + 0.00025 * k), speed);
    Space space = scene.table.begin();
    move(space, 0.55);
    scene.expect_asleep(space);
    const double momentum = scene.calc_momentum(space);
    move(space, 0.556);
    EXPECT_GT(space.state(scene.carrier).velocity[0], 1.0) << k;
    EXPECT_NEAR(scene.calc_momentum(space), momentum, 1e-6 * momentum) << k;
    EXPECT_LT(std::abs(space.state(scene.carrier).centre[2] - 0.02), 2e-6) << k << ": it went into what lies on it";
  }
}

TEST(sleep, wake_by_slow_load_and_sleep_again) {
  // A board on two blocks; the weight of a sliding block moves from one to the other.
  Table table;
  std::vector<int> blocks;
  for (const double x : {-0.3, 0.3}) blocks.push_back(table.add(make_box(0.2, {0.06, 0.1, 0.05}), {x, 0, 0.025}));
  const int board = table.add(make_box(0.5, {0.8, 0.1, 0.02}), {0, 0, 0.06});
  const int slider = table.add(make_smooth_box(0.2), {-0.25, 0, 0.09}, {0.25, 0, 0});
  Space space = table.begin();
  const double before_j = space.calc_books().motion_j;
  std::vector<int> slept(2), woke(2);
  std::vector<char> still(2);
  while (space.get_time() < 2.0) {
    space.step(2.0);
    for (std::size_t n = 0; n < 2; ++n) {
      const char now = space.is_still(blocks[n]) ? 1 : 0;
      slept[n] += now > still[n] ? 1 : 0;
      woke[n] += now < still[n] ? 1 : 0;
      still[n] = now;
    }
  }
  for (std::size_t n = 0; n < 2; ++n) {
    EXPECT_GE(slept[n], 3) << n;
    EXPECT_GE(woke[n], 2) << n;
  }
  for (const int body : {blocks[0], blocks[1], board}) EXPECT_LT(norm(space.state(body).centre - table.states[body].centre), 5e-6) << body;
  EXPECT_NEAR(space.state(slider).centre[0], 0.25, 5e-4);
  const Books after = space.calc_books();
  EXPECT_NEAR(after.calc_total(), before_j, 1e-8 * before_j);
}

TEST(sleep, swings_on_moving_bodies_die_down) {
  // A bowl that rocks: on a fixed block for as long as its rolling resistance allows, on a loose one much shorter.
  const tests::DropBody bowl = tests::make_drop_body(6, 1);
  double base_m = 0.0;  // below the centre of mass; the outside is a sphere of 80 mm
  for (const Vec3& x : bowl.vertices) base_m = std::max(base_m, -x[2]);
  for (const double tilt : {0.05, 0.35}) {
    std::array<double, 2> asleep_s{};
    for (const bool is_loose : {false, true}) {
      Table table;
      Solid block = make_box(20.0, {0.3, 0.3, 0.1});
      block.fixed = !is_loose;
      table.add(block, {0, 0, 0.05});
      const int rocker = table.add(bowl.solid, {0, 0, 0.1 + 0.08 - (0.08 - base_m) * std::cos(tilt)});
      table.states[rocker].rotation = {std::cos(0.5 * tilt), std::sin(0.5 * tilt), 0, 0};
      Space space = table.begin();
      const double before_j = space.calc_books().calc_total();
      while (space.get_time() < 8.0 && !space.is_still(rocker)) space.step(8.0);
      asleep_s[is_loose ? 1 : 0] = space.get_time();
      EXPECT_NEAR(space.calc_books().calc_total(), before_j, 1e-6) << tilt << is_loose;
    }
    EXPECT_GT(asleep_s[0], 2.5) << tilt;
    EXPECT_LT(asleep_s[1], tilt < 0.1 ? 1.7 : 3.0) << tilt;
  }
}

}  // namespace
}  // namespace carillon::rigid
