// Detection of folded quadratic elements, and the effect of straightening on their neighbours.
#include "precompute/mesh/curved.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "precompute/mesh/check.hpp"

namespace carillon::mesh {
namespace {

/// The unit tetrahedron, and with `two` its mirror image below the face z = 0; second order, straight.
TetMesh make_tets(bool two) {
  TetMesh mesh;
  mesh.nodes_m = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  mesh.tets = {0, 1, 2, 3};
  if (two) {
    mesh.nodes_m.push_back({0, 0, -1});
    mesh.tets.insert(mesh.tets.end(), {0, 2, 1, 4});
  }
  mesh.regions.assign(two ? 2 : 1, 0);
  return to_quadratic(mesh);
}

Vec3& get_middle_01(TetMesh& mesh) { return mesh.nodes_m[mesh.tets[4]]; }

TEST(curved, quarter_point_fold) {
  // Along the edge x(s) = s (1 - s) 4 m + s (2 s - 1): dx/ds at s = 0 is 4 m - 1, negative for m < 1/4, though positive at all Gauss
  // points.
  for (const auto& [m, folded] : {std::pair{0.27, false}, std::pair{0.245, true}, std::pair{0.73, false}, std::pair{0.755, true}}) {
    TetMesh mesh = make_tets(false);
    get_middle_01(mesh) = {m, 0, 0};
    EXPECT_EQ(is_folded(mesh, 0), folded) << m;
    EXPECT_NEAR(calc_jacobian(mesh, 0, {1, 0, 0, 0}), 4 * m - 1, 1e-15);
    const CheckReport report = check_mesh(mesh);
    EXPECT_EQ(report.straightened, folded ? 1 : 0);
    EXPECT_NEAR(get_middle_01(mesh)[0], folded ? 0.5 : m, 1e-15);
  }
}

TEST(curved, neighbours_of_straightened_elements) {
  TetMesh mesh = make_tets(true);
  get_middle_01(mesh) = {0.5, 0, 0.6};  // far up into the first element, out of the second
  EXPECT_TRUE(is_folded(mesh, 0));
  EXPECT_FALSE(is_folded(mesh, 1));
  EXPECT_TRUE(is_curved(mesh, 1));
  EXPECT_EQ(straighten_folded_elements(mesh), 1);
  EXPECT_FALSE(is_curved(mesh, 0));
  EXPECT_FALSE(is_curved(mesh, 1));
  EXPECT_EQ(straighten_folded_elements(mesh), 0);
}

TEST(curved, fold_detection) {
  // Jacobian by finite differences of the map, at the points of every quadrature rule, on mild to extreme elements.
  std::mt19937 random(7);
  std::uniform_real_distribution<double> unit(0, 1), shift(-1, 1);
  const auto map = [](const TetMesh& mesh, const std::array<double, 3>& xi) {
    const std::array<double, 4> l{1 - xi[0] - xi[1] - xi[2], xi[0], xi[1], xi[2]};
    Vec3 x{};
    for (int n = 0; n < 10; ++n) {
      const double shape = n < 4 ? l[n] * (2 * l[n] - 1) : 4 * l[kEdges[n - 4][0]] * l[kEdges[n - 4][1]];
      for (int c = 0; c < 3; ++c) x[c] += shape * mesh.nodes_m[mesh.tets[n]][c];
    }
    return x;
  };
  int passed = 0, refused = 0;
  for (int trial = 0; trial < 300; ++trial) {
    TetMesh mesh = make_tets(false);
    const double size = 0.35 * unit(random);
    for (int n = 4; n < 10; ++n)
      for (double& x : mesh.nodes_m[mesh.tets[n]]) x += size * shift(random);
    ++(is_folded(mesh, 0) ? refused : passed);
    if (is_folded(mesh, 0)) continue;
    for (int n = 0; n < 10; ++n) {  // the nodes, where curved elements fold first
      std::array<double, 3> xi{};
      if (n < 4) {
        if (n > 0) xi[n - 1] = 1;
      } else {
        for (const int c : kEdges[n - 4])
          if (c > 0) xi[c - 1] = 0.5;
      }
      constexpr double kStep = 1e-6;
      std::array<Vec3, 3> d{};
      for (int k = 0; k < 3; ++k) {
        auto low = xi, high = xi;
        low[k] -= kStep;
        high[k] += kStep;
        const Vec3 a = map(mesh, low), b = map(mesh, high);
        for (int c = 0; c < 3; ++c) d[k][c] = (b[c] - a[c]) / (2 * kStep);
      }
      const double det = d[0][0] * (d[1][1] * d[2][2] - d[1][2] * d[2][1]) - d[0][1] * (d[1][0] * d[2][2] - d[1][2] * d[2][0]) +
                         d[0][2] * (d[1][0] * d[2][1] - d[1][1] * d[2][0]);
      EXPECT_GT(det, -1e-8) << "trial " << trial << ", node " << n;
    }
  }
  EXPECT_GT(passed, 50);
  EXPECT_GT(refused, 50);
}

TEST(curved, straighten) {
  TetMesh mesh = make_tets(true);
  for (std::size_t n = 5; n < mesh.nodes_m.size(); ++n) mesh.nodes_m[n][1] += 0.1;
  straighten(mesh);
  EXPECT_EQ(mesh.nodes_m, make_tets(true).nodes_m);
}

}  // namespace
}  // namespace carillon::mesh
