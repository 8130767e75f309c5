// The same bits on any number of ranks. Oracle: the same bodies on one rank, which every rank computes by itself.
#include "tests/support/ranks.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>

#include "precompute/simulation/transient/motion.hpp"
#include "runtime/base/error.hpp"
#include "tests/support/catch_message.hpp"
#include "tests/unit/precompute/simulation/transient/bodies.hpp"

namespace carillon::transient {
namespace {

using testing::make_box;
using testing::make_law;
using testing::World;

/// Linear, straight and curved quadratic elements, with and without damping.
std::vector<SolidBody> make_bodies() {
  mesh::TetMesh above = make_box({0.05, 0.04, 0.03}, {3, 2, 2}, 2, 4e-4), slab = make_box({0.05, 0.04, 0.03}, {3, 2, 2}, 2);
  for (Vec3& x : above.nodes_m) x[2] += 0.1;
  for (Vec3& x : slab.nodes_m) x[1] += 0.1;
  // A straight and a curved half in one mesh.
  for (std::size_t n = 0; n < above.nodes_m.size(); ++n)
    if (above.nodes_m[n][0] < -0.01) above.nodes_m[n] = {slab.nodes_m[n][0], slab.nodes_m[n][1] - 0.1, slab.nodes_m[n][2] + 0.1};
  return {{"bar", make_box({0.2, 0.02, 0.02}, {10, 2, 2}, 1), make_law(70e9, 0.33, 2700, 2e-8), 20.0},
          {"block", above, make_law(5e8, 0.4, 1100), 3.0},
          {"slab", slab, make_law(2e9, 0.3, 1100, 1e-6), 0.0}};
}

struct Scene {
  explicit Scene(MPI_Comm comm) : world(make_bodies(), comm) {
    MotionOptions options;
    options.gravity_m_s2 = {0, 0, -9.81};
    options.settle_s = 1e-3;
    options.step_check_s = 2e-4;
    const Path path({{0.0, {0, 0, 0}}, {5e-4, {1e-3, 0, 2e-3}}, {1e-3, {0, 0, 0}}});
    motion = std::make_unique<Motion>(
        world.domain, options, std::vector<Constraint>{{world.list_set("x-min", 0), {}, false}, {world.list_set("x-max", 2), path, false}},
        std::vector<Impulse>{{1e-4, 2e-4, {0, 0.1, -1.0}, find_shares(*world.assembly, 0, {0.1, 0.0, 0.01})},
                             {0.0, 3e-4, {0.2, 0.1, -0.3}, find_shares(*world.assembly, 1, {0.0, 0.01, 0.2})}});
    motion->set_start([&](std::int32_t node, const Vec3& x) {
      return world.assembly->find_body_of_node(node) == 1 ? Motion::Start{{}, {-40.0 * x[1], 40.0 * x[0], 1.0}} : Motion::Start{};
    });
  }
  World world;
  std::unique_ptr<Motion> motion;
};

void expect_same(const Scene& here, const Scene& alone) {
  EXPECT_EQ(here.motion->get_step_count(), alone.motion->get_step_count());
  EXPECT_EQ(here.motion->get_step_s(), alone.motion->get_step_s());
  EXPECT_EQ(here.motion->get_omega_rad_s(), alone.motion->get_omega_rad_s());
  for (std::int32_t i = 0; i < here.world.domain.node_count(); ++i) {
    const std::size_t at = i;
    const std::size_t other = alone.world.domain.find_place(here.world.domain.find_number(i));
    ASSERT_EQ(std::memcmp(&here.motion->get_u()[at], &alone.motion->get_u()[other], sizeof(Quad)), 0) << here.world.domain.find_number(i);
    ASSERT_EQ(std::memcmp(&here.motion->get_v()[at], &alone.motion->get_v()[other], sizeof(Quad)), 0) << here.world.domain.find_number(i);
  }
}

void expect_same(const EnergyBook& a, const EnergyBook& b) {
  EXPECT_EQ(a.kinetic_j, b.kinetic_j);
  EXPECT_EQ(a.elastic_j, b.elastic_j);
  EXPECT_EQ(a.dissipated_j, b.dissipated_j);
  EXPECT_EQ(a.work_j, b.work_j);
  EXPECT_EQ(a.error_j, b.error_j);
}

TEST(Ranks, bit_identical_motion) {
  Scene here(MPI_COMM_WORLD), alone(MPI_COMM_SELF);
  EXPECT_EQ(here.world.domain.own_count() == here.world.assembly->node_count(), tests::get_ranks() == 1);
  double dissipated = 0.0;
  for (int part = 0; part < 12; ++part) {
    for (int i = 0; i < 10; ++i) {
      here.motion->advance_sample();
      alone.motion->advance_sample();
    }
    expect_same(here, alone);
    const EnergyBook book = here.motion->calc_book();
    expect_same(book, alone.motion->calc_book());
    EXPECT_LT(std::abs(book.relative_error), 1e-6);
    EXPECT_GE(book.dissipated_j, dissipated);
    dissipated = book.dissipated_j;
  }
  EXPECT_GT(here.motion->get_step_count(), 2000);
}

TEST(Ranks, resumption_on_other_ranks) {
  Scene here(MPI_COMM_WORLD), alone(MPI_COMM_SELF), later(MPI_COMM_WORLD);
  for (int i = 0; i < 7; ++i) here.motion->advance_sample();
  for (int i = 0; i < 5; ++i) here.motion->advance();
  const std::vector<std::byte> bytes = here.world.comm.broadcast(here.motion->save());
  for (int i = 0; i < 200; ++i) here.motion->advance();
  alone.motion->load(bytes);
  later.motion->load(bytes);
  for (int i = 0; i < 200; ++i) {
    alone.motion->advance();
    later.motion->advance();
  }
  expect_same(here, alone);
  expect_same(later, alone);
  const EnergyBook book = here.motion->calc_book();
  expect_same(book, later.motion->calc_book());
  expect_same(book, alone.motion->calc_book());
  const std::vector<std::byte> again = here.motion->save(), other = later.motion->save();
  EXPECT_EQ(again, other);
}

TEST(Ranks, invalid_state) {
  Scene here(MPI_COMM_WORLD);
  std::vector<std::byte> bytes = here.world.comm.broadcast(here.motion->save());
  for (const std::size_t length : {std::size_t{0}, std::size_t{10}, sizeof(double), bytes.size() / 2, bytes.size() - 1})
    EXPECT_EQ(tests::catch_message<InputError>([&] {
                here.motion->load(std::span(bytes).first(length));
              }).find("the saved motion is not of these bodies"),
              0U);
  bytes[0] = std::byte{0};
  EXPECT_THROW(here.motion->load(bytes), InputError);
}

TEST(Ranks, too_many_ranks) {
  if (tests::get_ranks() == 1) return;
  std::vector<SolidBody> bodies{{"one", make_box({0.2, 0.2, 0.2}, {1, 1, 1}, 1), make_law(1e9, 0.3, 1000), 0.0}};
  bodies[0].mesh.tets.resize(4);
  EXPECT_THROW(World world(bodies), InputError);
}

}  // namespace
}  // namespace carillon::transient
