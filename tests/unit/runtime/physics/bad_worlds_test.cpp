// Worlds that cannot be simulated, and the words that say so.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "runtime/base/error.hpp"
#include "runtime/physics/world.hpp"
#include "tests/support/catch_message.hpp"
#include "tests/unit/runtime/physics/solids.hpp"

namespace carillon::physics::tests {
namespace {

struct Case {
  const char* what;
  std::function<void(WorldSpec&, bank::Bank&)> spoil;
  std::vector<std::string> words;
};

const double kNan = std::numeric_limits<double>::quiet_NaN();

void move(WorldSpec& w, double x, double z) { w.bodies[0].initial.position_m = {x, 0, z}; }

/// The first body once more, in place of the shelf.
void add_twin(WorldSpec& w, double x, double y, double z) {
  w.bodies[1] = w.bodies[0];
  w.bodies[1].name = "twin";
  w.bodies[1].initial.position_m = {x, y, z};
}

const Case kCases[] = {
    {"no bank", [](auto& w, auto&) { w.bodies[0].bank = nullptr; }, {"'cup'", "no bank"}},
    {"restitution", [](auto& w, auto&) { w.bodies[0].restitution = 1.5; }, {"'cup'", "restitution", "1.5", "0..1"}},
    {"friction", [](auto& w, auto&) { w.bodies[0].friction = -1; }, {"'cup'", "friction", "-1"}},
    {"rolling", [](auto& w, auto&) { w.bodies[0].rolling_resistance = -1; }, {"'cup'", "rolling_resistance", "-1"}},
    {"velocity", [](auto& w, auto&) { w.bodies[0].velocity_m_s[1] = kNan; }, {"'cup'", "velocity", "finite"}},
    {"rotation", [](auto& w, auto&) { w.bodies[0].initial.rotation.fill(0); }, {"'cup'", "rotation", "1 0 0 0"}},
    {"fixed and moving",
     [](auto& w, auto&) {
       w.bodies[0].fixed = true;
       w.bodies[0].velocity_m_s = {1, 0, 0};
     },
     {"'cup'", "fixed", "velocity"}},
    {"mass", [](auto&, auto& b) { b.rigid.mass_kg = 0; }, {"'cup'", "mass"}},
    {"inertia", [](auto&, auto& b) { b.rigid.inertia_kg_m2[0] = -1; }, {"'cup'", "inertia", "positive definite"}},
    {"inertia against the triangle rule", [](auto&, auto& b) { b.rigid.inertia_kg_m2[0] *= 100; }, {"'cup'", "impossible inertia"}},
    {"material", [](auto&, auto& b) { b.material.young_modulus_pa = 0; }, {"'cup'", "young_modulus_pa"}},
    {"no triangles", [](auto&, auto& b) { b.triangles.clear(); }, {"'cup'", "no surface triangles"}},
    {"open", [](auto&, auto& b) { b.triangles.pop_back(); }, {"'cup'", "open at edge"}},
    {"doubled triangle", [](auto&, auto& b) { b.triangles.push_back(b.triangles[0]); }, {"'cup'", "not a manifold at edge"}},
    {"turned triangle", [](auto&, auto& b) { std::swap(b.triangles[0][0], b.triangles[0][1]); }, {"'cup'", "not a manifold at edge"}},
    {"index", [](auto&, auto& b) { b.triangles[3][1] = 77; }, {"'cup'", "triangle 3", "77"}},
    {"vertex", [](auto&, auto& b) { b.vertices_m[2][0] = kNan; }, {"'cup'", "vertex 2", "finite"}},
    {"inside out",
     [](auto&, auto& b) {
       for (auto& t : b.triangles) std::swap(t[0], t[1]);
     },
     {"'cup'", "inside out"}},
    {"in the ground", [](auto& w, auto&) { w.bodies[0].initial.position_m[2] = 0.01; }, {"'cup'", "10.00 mm", "ground", "raise"}},
    {"in each other", [](auto& w, auto&) { move(w, 1.0, 0.535); }, {"'cup'", "'shelf'", "inside each other", "5.00 mm"}},
    {"swallowed", [](auto& w, auto&) { move(w, 1.0, 0.502); }, {"'cup'", "'shelf'", "inside each other"}},
    {"one body twice at one place", [](auto& w, auto&) { add_twin(w, 0, 0, 0.3); }, {"'cup'", "'twin'", "inside each other", "13.33 mm"}},
    {"twins a hair apart", [](auto& w, auto&) { add_twin(w, 5e-5, 5e-5, 0.3 + 5e-5); }, {"'cup'", "'twin'", "inside each other"}},
    {"twins shifted along their faces", [](auto& w, auto&) { add_twin(w, 0.01, 0, 0.3); }, {"'cup'", "'twin'", "inside each other"}},
    {"gravity", [](auto& w, auto&) { w.gravity_m_s2[0] = kNan; }, {"gravity"}},
    {"ground", [](auto& w, auto&) { w.ground->height_m = kNan; }, {"ground", "height"}},
};

TEST(BadWorld, RefusalWithBodyAndReason) {
  for (const Case& c : kCases) {
    SCOPED_TRACE(c.what);
    bank::Bank cup = make_box({0.04, 0.04, 0.04}), plate = make_box({0.3, 0.2, 0.04});
    WorldSpec w;
    w.ground = GroundSpec{};
    BodySpec body;
    body.name = "cup";
    body.bank = &cup;
    body.initial.position_m = {0, 0, 0.3};
    w.bodies = {body, body};
    w.bodies[1].name = "shelf";
    w.bodies[1].bank = &plate;
    w.bodies[1].fixed = true;
    w.bodies[1].initial.position_m = {1, 0, 0.5};
    c.spoil(w, cup);
    carillon::tests::expect_error<InputError>(c.words, [&] { simulate(w, 0.01); });
  }
}

TEST(BadWorld, RefusalOfInvalidDuration) {
  EXPECT_THROW(simulate({}, -1.0), InputError);
  EXPECT_THROW(simulate({}, kNan), InputError);
}

TEST(BadWorld, OverlapsInAnyOrderAndDirection) {
  // A lattice of balls 3 cm wide and 4 cm apart, some fixed; then two are taken out of it and put 2 cm apart.
  const bank::Bank ball = make_ball(0.015, 2);
  constexpr int kSide = 3, kCount = kSide * kSide * kSide;
  WorldSpec lattice;
  for (int i = 0; i < kCount; ++i) {
    BodySpec body;
    body.name = "ball " + std::to_string(i);
    body.bank = &ball;
    body.fixed = i % 4 == 0;
    body.initial.position_m = {0.04 * (i % kSide), -0.04 * (i / kSide % kSide), 0.04 * (i / (kSide * kSide))};
    lattice.bodies.push_back(body);
  }
  EXPECT_NO_THROW(World{lattice});
  for (int i = 0; i < kCount; ++i) {
    const std::size_t moved = (7 * i + 3) % kCount, still = i;
    if (moved == still) continue;
    WorldSpec spec = lattice;
    BodySpec &a = spec.bodies[still], &b = spec.bodies[moved];
    a.initial.position_m = {1.0, 2.0, 3.0};
    b.initial.position_m = a.initial.position_m;
    b.initial.position_m[still % 3] += i % 2 == 0 ? 0.02 : -0.02;
    if (a.fixed && b.fixed) {
      EXPECT_NO_THROW(World{spec}) << i;
      continue;
    }
    const std::string first = spec.bodies[std::min(still, moved)].name, second = spec.bodies[std::max(still, moved)].name;
    carillon::tests::expect_error<InputError>({"bodies '" + first + "' and '" + second + "' start inside each other"},
                                              [&] { World world(spec); });
  }
}

TEST(EmptyWorld, IsSilent) {
  const Simulation s = simulate({}, 0.1);
  EXPECT_TRUE(s.impulses.empty());
  EXPECT_TRUE(s.poses.empty());
}

}  // namespace
}  // namespace carillon::physics::tests
