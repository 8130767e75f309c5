// Each tetrahedron is cut into eight: body, sets and curved sides are preserved.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "precompute/mesh/check.hpp"
#include "precompute/mesh/shapes/shapes.hpp"
#include "precompute/run/stages.hpp"

namespace carillon::run {
namespace {

TEST(Refine, makes_eight_of_each_and_keeps_the_volume_for_both_orders) {
  for (const int order : {1, 2}) {
    mesh::TetMesh box = shapes::make_box({0.3, 0.02, 0.01}, {5, 2, 1}, order);
    const mesh::TetMesh old = box;
    mesh::TetMesh fine = refine_mesh(box);
    EXPECT_EQ(fine.order, order);
    EXPECT_EQ(fine.tet_count(), 8 * old.tet_count());
    const mesh::CheckReport report = mesh::check_mesh(fine);  // throws for an inconsistent mesh
    EXPECT_EQ(report.reoriented, 0);
    EXPECT_EQ(report.welded, 0);
    EXPECT_EQ(report.unreferenced, 0);
    EXPECT_EQ(report.curved, 0);
    EXPECT_EQ(report.components, 1);
    EXPECT_NEAR(report.volume_m3, 0.3 * 0.02 * 0.01, 1e-15);
    EXPECT_EQ(report.boundary_faces, 4 * mesh::check_mesh(box).boundary_faces);
  }
}

TEST(Refine, gives_the_nodes_that_a_lattice_twice_as_fine_has) {
  for (const int order : {1, 2}) {
    const mesh::TetMesh fine = refine_mesh(shapes::make_box({0.3, 0.02, 0.01}, {3, 2, 1}, order));
    mesh::TetMesh lattice = shapes::make_box({0.3, 0.02, 0.01}, {6, 4, 2}, order);
    EXPECT_EQ(fine.tet_count(), lattice.tet_count());
    if (order == 1) {
      EXPECT_EQ(fine.nodes_m.size(), lattice.nodes_m.size());
    }
    for (const auto& [name, nodes] : fine.node_sets) {
      // Face sets: exactly the nodes on the faces.
      const std::size_t axis = name[0] - 'x';
      const double side = std::array{0.3, 0.02, 0.01}[axis] / 2 * (name.ends_with("min") ? -1 : 1);
      std::vector<std::int32_t> expected;
      for (std::size_t i = 0; i < fine.nodes_m.size(); ++i)
        if (std::abs(fine.nodes_m[i][axis] - side) < 1e-12) expected.push_back(static_cast<std::int32_t>(i));
      EXPECT_EQ(nodes, expected) << name << " order " << order;
    }
  }
}

TEST(Refine, keeps_the_curved_body_exactly) {
  mesh::TetMesh ball = shapes::make_shape({.shape = "sphere", .dimensions = {{"radius", 0.05}}, .order = 2, .target_nodes = 800});
  const double before = mesh::check_mesh(ball).volume_m3;
  mesh::TetMesh fine = refine_mesh(ball);
  const mesh::CheckReport report = mesh::check_mesh(fine);
  EXPECT_NEAR(report.volume_m3 / before, 1, 1e-12);  // the same quadratic maps, subdivided
  EXPECT_GT(report.curved, 0);
  EXPECT_EQ(report.straightened, 0);
  // Old nodes keep their numbers and positions.
  for (std::size_t i = 0; i < ball.nodes_m.size(); ++i) EXPECT_EQ(fine.nodes_m[i], ball.nodes_m[i]);
}

TEST(Refine, does_not_worsen_elements_without_end) {
  mesh::TetMesh mesh = shapes::make_shape({.shape = "sphere", .dimensions = {{"radius", 0.05}}, .order = 1, .target_nodes = 200});
  const double before = mesh::check_mesh(mesh).mean_ratio_min;
  for (int i = 0; i < 3; ++i) mesh = refine_mesh(mesh);
  EXPECT_GT(mesh::check_mesh(mesh).mean_ratio_min, 0.4 * before);
}

TEST(Refine, keeps_the_regions) {
  mesh::TetMesh box = shapes::make_box({0.2, 0.1, 0.1}, {2, 1, 1}, 2);
  for (std::int64_t e = 0; e < box.tet_count(); ++e) box.regions[e] = e < 6 ? 3 : 8;
  const mesh::TetMesh fine = refine_mesh(box);
  EXPECT_EQ(std::count(fine.regions.begin(), fine.regions.end(), 3), 48);
  EXPECT_EQ(std::count(fine.regions.begin(), fine.regions.end(), 8), 48);
}

}  // namespace
}  // namespace carillon::run
