// Every mesh accepted by the check is accepted by the assembly: randomly bent curved elements, many of them folded.
#include <gtest/gtest.h>

#include <random>

#include "precompute/fem/element.hpp"
#include "precompute/mesh/curved.hpp"
#include "tests/support/box_mesh.hpp"

namespace carillon::fem {
namespace {

int count_refused(const mesh::TetMesh& mesh) {
  const material::Material material{.young_modulus_pa = 1e9, .poisson_ratio = 0.3, .density_kg_m3 = 1000, .alpha1_s = 0, .alpha2_per_s = 0};
  ElementMatrices element;
  int refused = 0;
  for (std::int64_t e = 0; e < mesh.tet_count(); ++e) {
    std::vector<Vec3> x;
    for (const auto node : mesh.tet(e)) x.push_back(mesh.nodes_m[node]);
    refused += !calc_element(x, material, job::Mass::consistent, element);
  }
  return refused;
}

TEST(FoldedElements, are_straightened_until_assembly_refuses_none) {
  std::mt19937 random(5);
  for (const double bow : {0.02, 0.05, 0.1, 0.3}) {
    mesh::TetMesh mesh = tests::make_box({4, 4, 4}, {1, 1, 1}, 2);
    std::vector<bool> is_mid(mesh.nodes_m.size(), false);
    for (std::int64_t e = 0; e < mesh.tet_count(); ++e)
      for (int i = 4; i < 10; ++i) is_mid[mesh.tet(e)[i]] = true;
    std::uniform_real_distribution<double> push(-bow, bow);
    for (std::size_t i = 0; i < mesh.nodes_m.size(); ++i)
      if (is_mid[i])
        for (double& x : mesh.nodes_m[i]) x += push(random);
    const int refused = count_refused(mesh);
    const std::int64_t straightened = mesh::straighten_folded_elements(mesh);
    EXPECT_GE(straightened, refused > 0) << bow;
    EXPECT_EQ(count_refused(mesh), 0) << bow;
    if (bow > 0.2) {
      EXPECT_GT(refused, 100);
    }
  }
}

}  // namespace
}  // namespace carillon::fem
