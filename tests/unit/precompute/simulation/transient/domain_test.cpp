// Partition of the bodies over ranks. Oracles: sums over the whole mesh, and hand-made values.
#include "precompute/simulation/transient/domain.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <set>

#include "runtime/base/error.hpp"
#include "tests/support/catch_message.hpp"
#include "tests/support/ranks.hpp"
#include "tests/unit/precompute/simulation/transient/bodies.hpp"

namespace carillon::transient {
namespace {

using testing::make_box;
using testing::make_law;
using testing::World;

std::vector<SolidBody> make_two_bodies() {
  mesh::TetMesh above = make_box({0.05, 0.04, 0.03}, {2, 2, 2}, 2, 4e-4);
  for (Vec3& x : above.nodes_m) x[2] += 0.1;
  return {{"bar", make_box({0.2, 0.02, 0.02}, {8, 2, 2}, 1), make_law(70e9, 0.33, 2700), 0.0},
          {"block", above, make_law(2e6, 0.4, 1100), 3.0}};
}

TEST(Assembly, elements_and_node_order) {
  const World world(make_two_bodies());
  const Assembly& all = *world.assembly;
  ASSERT_EQ(all.bodies.size(), 2U);
  EXPECT_EQ(all.node_count(), static_cast<std::int32_t>(world.bodies[0].mesh.nodes_m.size() + world.bodies[1].mesh.nodes_m.size()));
  for (std::size_t b = 0; b < 2; ++b) {
    const Assembly::Body& body = all.bodies[b];
    const mesh::TetMesh& mesh = world.bodies[b].mesh;
    std::set<std::int32_t> elements;
    std::int32_t lowest = -1;
    for (std::int32_t e = body.first_element; e < body.last_element; ++e) {
      EXPECT_EQ(all.find_body(e), static_cast<std::int32_t>(b));
      const std::int32_t of_mesh = all.element_of_mesh[e];
      elements.insert(of_mesh);
      const auto here = all.find_nodes(e), there = mesh.tet(of_mesh);
      for (std::size_t a = 0; a < here.size(); ++a) {
        EXPECT_EQ(here[a], body.node_of_mesh[there[a]]);
        EXPECT_EQ(all.nodes_m[here[a]], mesh.nodes_m[there[a]]);
        EXPECT_EQ(all.find_body_of_node(here[a]), static_cast<std::int32_t>(b));
      }
      const std::int32_t first = *std::min_element(here.begin(), here.end());
      if (e != body.first_curved) {
        EXPECT_GE(first, lowest);
      }
      lowest = first;
      EXPECT_EQ(all.find_kind(e), b == 0 ? Kind::kT4 : e < body.first_curved ? Kind::kT10 : Kind::kCurvedT10);
    }
    EXPECT_EQ(elements.size(), static_cast<std::size_t>(mesh.tet_count()));
  }
}

// Closed surface: the facet area vectors sum to zero, and the volume is the box's.
TEST(Assembly, skin_and_point_shares) {
  const World world(make_two_bodies());
  const auto skin = list_skin(*world.assembly, 0);
  EXPECT_EQ(skin.size(), 2U * 2 * (8 * 2 + 8 * 2 + 2 * 2));
  double volume = 0.0;
  for (const auto& facet : skin) {
    EXPECT_EQ(facet[3], -1);
    const auto at = [&](std::size_t i) { return world.assembly->nodes_m[facet[i]]; };
    volume += dot(at(0), cross(at(1), at(2))) / 6.0;
  }
  EXPECT_NEAR(volume, 0.2 * 0.02 * 0.02, 1e-18);
  for (const auto& facet : list_skin(*world.assembly, 1))
    for (std::size_t i = 0; i < 3; ++i) {
      const auto at = [&](std::size_t n) { return world.assembly->nodes_m[facet[n]]; };
      EXPECT_LT(norm(at(3 + i) - 0.5 * (at(i) + at((i + 1) % 3))), 1e-3);  // mid nodes between their corners, but for the bend
    }
  for (std::int32_t body : {0, 1}) {
    const Vec3 point = body == 0 ? Vec3{0.043, 0.003, 0.02} : Vec3{0.004, 0.002, 0.2};
    double sum = 0.0, distance = 0.0;
    Vec3 place{};
    for (const NodeShare& one : find_shares(*world.assembly, body, point, &distance)) {
      sum += one.share;
      place = place + one.share * world.assembly->nodes_m[one.node];
      EXPECT_EQ(world.assembly->find_body_of_node(one.node), body);
    }
    EXPECT_NEAR(sum, 1.0, 1e-14);
    if (body == 0) {
      EXPECT_NEAR(distance, 0.01, 1e-15);
      EXPECT_LT(norm(place - Vec3{0.043, 0.003, 0.01}), 1e-15);
    }
  }
}

TEST(Domain, ownership_and_mass) {
  const World world(make_two_bodies());
  std::vector<std::int32_t> owned(world.assembly->node_count(), 0);
  for (std::int32_t i = 0; i < world.domain.own_count(); ++i) ++owned[world.domain.find_number(i)];
  world.comm.sum(std::span<std::int32_t>(owned));
  for (const std::int32_t count : owned) EXPECT_EQ(count, 1);
  for (std::int32_t i = 0; i < world.domain.node_count(); ++i) EXPECT_EQ(world.domain.find_place(world.domain.find_number(i)), i);
  // The curved block's volume: of its facets, six nodes each, by the divergence theorem and the rule of the three mid points a facet's four
  // triangles would only approximate; a block whose inner and outer mid nodes moved by 0.4 mm keeps its volume to a few per cent.
  EXPECT_NEAR(world.calc_mass(), 2700 * 0.2 * 0.02 * 0.02 + 1100 * 0.05 * 0.04 * 0.03, 0.03 * 1100 * 0.05 * 0.04 * 0.03);
  EXPECT_EQ(world.comm.sum(
                static_cast<std::int64_t>(world.domain.calc_state(std::vector<Quad>(world.domain.node_count()).data()).element.size())),
            world.assembly->element_count());
}

TEST(Domain, halo_exchange) {
  World world(make_two_bodies());
  std::vector<Quad> values(world.domain.node_count(), Quad{-1, -1, -1, 0});
  for (int round = 1; round < 4; ++round) {
    for (std::int32_t i = 0; i < world.domain.own_count(); ++i) {
      const double number = world.domain.find_number(i);
      values[i] = {round * number, number + 0.5, -number, 0.0};
    }
    world.domain.begin_halo(values.data());
    world.domain.end_halo(values.data());
    for (std::int32_t i = 0; i < world.domain.node_count(); ++i) {
      EXPECT_EQ(values[i].x, round * world.domain.find_number(i));
      EXPECT_EQ(values[i].y, world.domain.find_number(i) + 0.5);
    }
  }
}

TEST(Domain, sliver) {
  std::vector<SolidBody> bodies{{"bar", make_box({0.2, 0.02, 0.02}, {8, 2, 2}, 1), make_law(70e9, 0.33, 2700), 0.0}};
  mesh::TetMesh& mesh = bodies[0].mesh;
  // One inner node almost on its opposite facet.
  std::int32_t inner = -1;
  for (std::size_t n = 0; n < mesh.nodes_m.size(); ++n)
    if (norm(mesh.nodes_m[n] - Vec3{0.05, 0.0, 0.0}) < 1e-9) inner = static_cast<std::int32_t>(n);
  ASSERT_GE(inner, 0);
  for (std::int64_t e = 0; e < mesh.tet_count(); ++e) {
    const auto tet = mesh.tet(e);
    const auto at = std::find(tet.begin(), tet.end(), inner);
    if (at == tet.end()) continue;
    Vec3 opposite{};
    for (const std::int32_t node : tet)
      if (node != inner) opposite = opposite + (1.0 / 3.0) * mesh.nodes_m[node];
    mesh.nodes_m[inner] = 0.97 * opposite + 0.03 * mesh.nodes_m[inner];
    const std::string message = tests::catch_message<InputError>([&] { World world(bodies); });
    const std::string begin = "body 'bar', element ";
    ASSERT_EQ(message.find(begin), 0U) << message;
    const auto named = mesh.tet(std::stol(message.substr(begin.size())) - 1);
    EXPECT_NE(std::find(named.begin(), named.end(), inner), named.end()) << message;
    EXPECT_NE(message.find("is a sliver: it allows a step of "), std::string::npos) << message;
    return;
  }
}

TEST(Domain, invalid_solids) {
  EXPECT_EQ(tests::catch_message<InputError>([] { World world(std::vector<SolidBody>{}); }), "the job has no body");
  std::vector<SolidBody> bodies{{"bar", make_box({0.2, 0.02, 0.02}, {4, 1, 1}, 1), make_law(70e9, 0.33, -2700), 0.0}};
  EXPECT_NE(tests::catch_message<InputError>([&] { World world(bodies); }).find("body 'bar': lambda"), std::string::npos);
  bodies[0].law = make_law(70e9, 0.33, 2700);
  std::swap(bodies[0].mesh.tets[0], bodies[0].mesh.tets[1]);
  EXPECT_NE(tests::catch_message<InputError>([&] { World world(bodies); }).find("body 'bar': element 1 of its mesh"), std::string::npos);
}

// rho t A, of vertices only: edge angles have their own inertia.
TEST(Domain, sheet_mass) {
  const comm::Communicator comm(MPI_COMM_WORLD);
  SheetBody sheet{"sheet", make_disc(0.1, 12), {}, {8e10, 6e10, 7000.0, 0.002, 0.0}, 0.0};
  sheet.clamped.assign(sheet.mesh.vertices_m.size(), false);
  const auto assembly = std::make_shared<const Assembly>(make_assembly(comm, std::vector<AnyBody>{sheet}));
  const Domain domain(comm, assembly);
  double mass = 0.0;
  for (std::int32_t place = 0; place < domain.own_count(); ++place)
    if (domain.is_point(place)) mass += domain.get_masses_kg()[place];
  const double area = 36 * 0.5 * 0.01 * std::sin(2 * std::numbers::pi / 36);  // of the polygon
  EXPECT_NEAR(comm.sum(mass), 7000.0 * 0.002 * area, 1e-13);
}

}  // namespace
}  // namespace carillon::transient
