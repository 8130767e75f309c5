// Distribution and assembly on 1, 2 and 3 ranks against closed forms of fields on a box.
#include "precompute/fem/assemble.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numeric>
#include <set>

#include "precompute/mesh/distributed/distribute.hpp"
#include "precompute/petsc/session.hpp"
#include "tests/support/box_mesh.hpp"
#include "tests/support/catch_message.hpp"
#include "tests/support/ranks.hpp"

namespace carillon::fem {
namespace {

using testing::HasSubstr;
using tests::get_rank;
using tests::get_ranks;

const MPI_Comm kWorld = MPI_COMM_WORLD;
const material::Material kSteel{.young_modulus_pa = 200e9, .poisson_ratio = 0.3, .density_kg_m3 = 7850, .alpha1_s = 0, .alpha2_per_s = 0};
constexpr std::array<double, 3> kSize{0.3, 0.2, 0.1};

mesh::TetMesh on_rank_0(const mesh::TetMesh& whole) { return get_rank() == 0 ? whole : mesh::TetMesh{}; }

mesh::DistributedMesh distribute_box(const mesh::TetMesh& whole, const std::vector<std::int32_t>& fixed = {}) {
  return mesh::distribute(kWorld, on_rank_0(whole), get_rank() == 0 ? fixed : std::vector<std::int32_t>{}, {.elimination_order = true});
}

using Field = std::function<Vec3(const Vec3&)>;

petsc::VecHandle sample(const System& system, const mesh::LocalMesh& local, const Field& field) {
  petsc::VecHandle vector;
  petsc::check(MatCreateVecs(system.stiffness, vector.out(), nullptr));
  double* values = nullptr;
  petsc::check(VecGetArray(vector, &values));
  for (int i = 0; i < local.free_nodes; ++i) {
    const Vec3 value = field(local.nodes_m[i]);
    for (int d = 0; d < 3; ++d) values[3 * i + d] = value[d];
  }
  petsc::check(VecRestoreArray(vector, &values));
  return vector;
}

double product(const Mat matrix, const Vec x, const Vec y) {
  petsc::VecHandle image;
  petsc::check(VecDuplicate(x, image.out()));
  petsc::check(MatMult(matrix, y, image));
  double value = 0;
  petsc::check(VecDot(x, image, &value));
  return value;
}

double find_norm(const Mat matrix) {
  double norm = 0;
  petsc::check(MatNorm(matrix, NORM_FROBENIUS, &norm));
  return norm;
}

class Assembly : public testing::TestWithParam<std::tuple<int, job::Mass>> {
 protected:
  int order() const { return std::get<0>(GetParam()); }
  mesh::TetMesh box = tests::make_box({5, 4, 3}, kSize, order());
  mesh::DistributedMesh pieces = distribute_box(box);
  System system = assemble(kWorld, pieces.local, kSteel, std::get<1>(GetParam()));
};

TEST_P(Assembly, gives_the_strain_energy_of_two_linear_fields_to_rounding) {
  const auto x = sample(system, pieces.local, [](const Vec3& p) { return Vec3{p[0] + 2 * p[1], 0, 3 * p[2]}; });
  const auto y = sample(system, pieces.local, [](const Vec3& p) { return Vec3{p[0], p[0] - p[1], p[1]}; });
  // sigma(x) : eps(y) V with eps(x) = [1 1 0; 1 0 0; 0 0 3], eps(y) = [1 .5 0; .5 -1 .5; 0 .5 0].
  const double lambda = kSteel.lame_lambda_pa(), mu = kSteel.lame_mu_pa();
  const double expected = (lambda * 4 * 0 + 2 * mu * (1 + 2 * 0.5)) * kSize[0] * kSize[1] * kSize[2];
  EXPECT_NEAR(product(system.stiffness, x, y), expected, 1e-12 * expected);
}

TEST_P(Assembly, gives_no_force_under_rigid_motions) {
  for (int motion = 0; motion < 6; ++motion) {
    const int a = motion % 3, b = (a + 1) % 3, c = (a + 2) % 3;
    const auto x = sample(system, pieces.local, [&](const Vec3& p) {
      Vec3 u{};
      if (motion < 3) {
        u[a] = 1;
      } else {
        u[b] = -p[c];
        u[c] = p[b];
      }
      return u;
    });
    petsc::VecHandle force;
    petsc::check(VecDuplicate(x, force.out()));
    petsc::check(MatMult(system.stiffness, x, force));
    double norm = 0;
    petsc::check(VecNorm(force, NORM_2, &norm));
    EXPECT_LT(norm, 1e-13 * find_norm(system.stiffness)) << motion;
  }
}

TEST_P(Assembly, gives_the_mass_in_every_direction_and_none_between_directions) {
  const double expected = 7850 * kSize[0] * kSize[1] * kSize[2];
  for (int a = 0; a < 3; ++a)
    for (int b = 0; b < 3; ++b) {
      const auto x = sample(system, pieces.local, [&](const Vec3&) { return Vec3{a == 0 ? 1. : 0., a == 1 ? 1. : 0., a == 2 ? 1. : 0.}; });
      const auto y = sample(system, pieces.local, [&](const Vec3&) { return Vec3{b == 0 ? 1. : 0., b == 1 ? 1. : 0., b == 2 ? 1. : 0.}; });
      EXPECT_NEAR(product(system.mass, x, y), a == b ? expected : 0, 1e-12 * expected);
    }
}

TEST_P(Assembly, gives_exactly_the_kinetic_energy_of_a_linear_field_when_consistent) {
  const auto x = sample(system, pieces.local, [](const Vec3& p) { return Vec3{p[0], 0, 0}; });
  const double exact = 7850 * std::pow(kSize[0], 3) / 3 * kSize[1] * kSize[2];
  const double value = product(system.mass, x, x);
  if (std::get<1>(GetParam()) == job::Mass::consistent) {
    EXPECT_NEAR(value, exact, 1e-12 * exact);
  } else {
    EXPECT_NEAR(value, exact, 0.05 * exact);
  }
}

TEST_P(Assembly, stores_nine_entries_of_stiffness_and_three_of_mass_for_each_pair_of_nodes_that_share_an_element) {
  std::set<std::pair<std::int32_t, std::int32_t>> pairs;
  for (std::int64_t e = 0; e < box.tet_count(); ++e)
    for (const auto i : box.tet(e))
      for (const auto j : box.tet(e)) pairs.emplace(i, j);
  const bool lumped = std::get<1>(GetParam()) == job::Mass::lumped;
  const auto count = [](const Mat matrix) {
    MatInfo info;
    petsc::check(MatGetInfo(matrix, MAT_GLOBAL_SUM, &info));
    return info.nz_used;
  };
  EXPECT_EQ(count(system.stiffness), 9.0 * static_cast<double>(pairs.size()));
  EXPECT_EQ(count(system.mass), 3.0 * static_cast<double>(lumped ? box.nodes_m.size() : pairs.size()));
}

TEST_P(Assembly, gives_symmetric_matrices) {
  const auto x = sample(system, pieces.local, [](const Vec3& p) { return Vec3{std::sin(40 * p[0]), std::cos(31 * p[1]), p[2]}; });
  const auto y = sample(system, pieces.local, [](const Vec3& p) { return Vec3{std::cos(17 * p[2]), p[0] * p[1], std::exp(9 * p[1])}; });
  for (const Mat matrix : {system.stiffness.get(), system.mass.get()}) EXPECT_NEAR(product(matrix, x, y) / product(matrix, y, x), 1, 1e-10);
}

INSTANTIATE_TEST_SUITE_P(All, Assembly, testing::Combine(testing::Values(1, 2), testing::Values(job::Mass::consistent, job::Mass::lumped)),
                         [](const auto& info) {
                           return std::string(std::get<0>(info.param) == 1 ? "T4_" : "T10_") +
                                  (std::get<1>(info.param) == job::Mass::consistent ? "consistent" : "lumped");
                         });

TEST(Elimination, of_fixed_nodes_leaves_the_rows_of_the_others_as_they_were) {
  const auto box = tests::make_box({3, 2, 2}, kSize, 2);
  std::vector<std::int32_t> fixed;
  for (std::size_t i = 0; i < box.nodes_m.size(); ++i)
    if (box.nodes_m[i][0] == 0) fixed.push_back(static_cast<std::int32_t>(i));
  const mesh::DistributedMesh pieces = distribute_box(box, fixed);
  const System system = assemble(kWorld, pieces.local, kSteel, job::Mass::consistent);
  PetscInt rows = 0;
  petsc::check(MatGetSize(system.stiffness, &rows, nullptr));
  EXPECT_EQ(rows, 3 * static_cast<PetscInt>(box.nodes_m.size() - fixed.size()));
  // A field that is zero on the fixed face has the energy of the free body: u_x = x, hence E_oed V.
  const auto x = sample(system, pieces.local, [](const Vec3& p) { return Vec3{p[0], 0, 0}; });
  const double expected = (kSteel.lame_lambda_pa() + 2 * kSteel.lame_mu_pa()) * kSize[0] * kSize[1] * kSize[2];
  EXPECT_NEAR(product(system.stiffness, x, x), expected, 1e-12 * expected);
}

TEST(Assembling, a_mesh_with_an_element_inside_out_fails_on_every_rank_and_names_it) {
  auto box = tests::make_box({3, 2, 2}, kSize);
  std::swap(box.tets[4 * 17], box.tets[4 * 17 + 1]);
  const mesh::DistributedMesh pieces = distribute_box(box);
  tests::expect_error<InputError>({"element 18 of the mesh"}, [&] { assemble(kWorld, pieces.local, kSteel, job::Mass::consistent); });
}

TEST(RigidData, of_a_box_far_from_the_origin_is_exact) {
  for (const int order : {1, 2}) {
    const mesh::DistributedMesh pieces = distribute_box(tests::make_box({4, 3, 2}, kSize, order, {100, -50, 20}));
    const RigidBody body = calc_rigid_body(kWorld, pieces.local, kSteel);
    const double mass = 7850 * kSize[0] * kSize[1] * kSize[2];
    EXPECT_NEAR(body.volume_m3, mass / 7850, 1e-13);
    EXPECT_NEAR(body.mass_kg, mass, 1e-10);
    const Vec3 centre{100 + kSize[0] / 2, -50 + kSize[1] / 2, 20 + kSize[2] / 2};
    for (int r = 0; r < 3; ++r) {
      EXPECT_NEAR(body.centre_m[r], centre[r], 1e-11);
      for (int c = 0; c < 3; ++c) {
        const double a = kSize[(r + 1) % 3], b = kSize[(r + 2) % 3];
        EXPECT_NEAR(body.inertia_kg_m2[3 * r + c], r == c ? mass / 12 * (a * a + b * b) : 0.0, 1e-11);
      }
    }
  }
}

}  // namespace
}  // namespace carillon::fem
