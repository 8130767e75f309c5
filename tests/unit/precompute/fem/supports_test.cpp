// Reactions at patches of fixed nodes on 1, 2 and 3 ranks: fields of constant strain, and the global balance.
#include "precompute/fem/supports.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "precompute/fem/assemble.hpp"
#include "precompute/mesh/distributed/distribute.hpp"
#include "precompute/petsc/session.hpp"
#include "tests/support/box_mesh.hpp"
#include "tests/support/ranks.hpp"

namespace carillon::fem {
namespace {

using tests::get_rank;

const MPI_Comm kWorld = MPI_COMM_WORLD;
const material::Material kSteel{.young_modulus_pa = 200e9, .poisson_ratio = 0.3, .density_kg_m3 = 7850, .alpha1_s = 0, .alpha2_per_s = 0};
constexpr std::array<double, 3> kSize{0.3, 0.04, 0.02};
constexpr std::array<int, 3> kCells{15, 4, 2};

using Field = std::function<Vec3(const Vec3&)>;
/// Entry of the job that fixes a point, -1: none.
using Fix = std::function<std::int32_t(const Vec3&)>;

struct Body {
  Body(int order, job::Mass mass, const Fix& fix) : mass(mass) {
    const mesh::TetMesh whole = tests::make_box(kCells, kSize, order);
    std::vector<std::int32_t> fixed;
    for (std::size_t i = 0; i < whole.nodes_m.size(); ++i)
      if (fix(whole.nodes_m[i]) >= 0) fixed.push_back(static_cast<std::int32_t>(i));
    pieces = mesh::distribute(kWorld, get_rank() == 0 ? whole : mesh::TetMesh{}, get_rank() == 0 ? fixed : std::vector<std::int32_t>{});
    for (const Vec3& x : pieces.local.nodes_m) pieces.local.fixed_by.push_back(fix(x));
    system = assemble(kWorld, pieces.local, kSteel, mass);
  }

  petsc::MatHandle sample(const std::vector<Field>& fields) const {
    petsc::MatHandle shapes;
    petsc::check(MatCreateDense(kWorld, 3 * pieces.local.free_nodes, PETSC_DECIDE, PETSC_DETERMINE, static_cast<PetscInt>(fields.size()),
                                nullptr, shapes.out()));
    double* values = nullptr;
    PetscInt stride = 0;
    petsc::check(MatDenseGetLDA(shapes, &stride));
    petsc::check(MatDenseGetArray(shapes, &values));
    for (std::size_t j = 0; j < fields.size(); ++j)
      for (int i = 0; i < pieces.local.free_nodes; ++i) {
        const Vec3 u = fields[j](pieces.local.nodes_m[i]);
        for (int d = 0; d < 3; ++d) values[static_cast<PetscInt>(j) * stride + 3 * i + d] = u[d];
      }
    petsc::check(MatDenseRestoreArray(shapes, &values));
    petsc::check(MatAssemblyBegin(shapes, MAT_FINAL_ASSEMBLY));
    petsc::check(MatAssemblyEnd(shapes, MAT_FINAL_ASSEMBLY));
    return shapes;
  }

  Supports calc(const std::vector<Field>& fields, const std::vector<double>& lambda) const {
    const petsc::MatHandle shapes = sample(fields);
    return calc_supports(kWorld, pieces.local, kSteel, mass, lambda, shapes);
  }

  job::Mass mass;
  mesh::DistributedMesh pieces;
  System system;
};

std::int32_t at_end(const Vec3& x) { return x[0] < 1e-9 ? 0 : -1; }
std::int32_t at_both_ends(const Vec3& x) { return x[0] < 1e-9 || x[0] > kSize[0] - 1e-9 ? 0 : -1; }
std::int32_t nowhere(const Vec3&) { return -1; }

class Reactions : public testing::TestWithParam<int> {};

TEST_P(Reactions, of_constant_strain_are_stress_times_area) {
  const Body body(GetParam(), job::Mass::consistent, at_end);
  // Stretched along x without lateral contraction; sheared along z.
  const std::vector<Field> fields{[](const Vec3& x) {
                                    return Vec3{1e-3 * x[0], 0, 0};
                                  },
                                  [](const Vec3& x) {
                                    return Vec3{0, 0, 1e-3 * x[0]};
                                  }};
  const Supports supports = body.calc(fields, {0.0, 0.0});
  ASSERT_EQ(supports.list.size(), 1U);
  const double mu = kSteel.lame_mu_pa(), area = kSize[1] * kSize[2];
  const double stretch = -1e-3 * (kSteel.lame_lambda_pa() + 2 * mu) * area, shear = -1e-3 * mu * area;
  const double expected[2][3] = {{stretch, 0, 0}, {0, 0, shear}};
  for (int m = 0; m < 2; ++m)
    for (int k = 0; k < 3; ++k) EXPECT_NEAR(supports.reaction[6 * m + k], expected[m][k], 1e-11 * std::abs(stretch)) << m << k;
  for (int k = 3; k < 6; ++k) EXPECT_NEAR(supports.reaction[k], 0.0, 1e-11 * std::abs(stretch) * kSize[1]) << "about the centre";
}

TEST_P(Reactions, balance_force_and_couple_of_all_that_moves) {
  // Sum of (K phi - lambda M phi) over all nodes: -lambda times the integrals of rho phi and (x - c) cross rho phi; on the free nodes: the
  // residual, known from K and M of the free nodes and a polynomial's integral over the box.
  const Body body(GetParam(), job::Mass::consistent, at_end);
  const Field field = [](const Vec3& x) { return Vec3{x[0] * x[2], x[0], -2 * x[0]}; };
  const double lambda = 3e7;
  const Field used = GetParam() == 2 ? field : Field([](const Vec3& x) { return Vec3{3 * x[0], x[0], -2 * x[0]}; });
  const Supports supports = body.calc({used}, {lambda});
  const petsc::MatHandle shapes = body.sample({used});
  petsc::VecHandle phi, force, inertia;
  petsc::check(MatCreateVecs(body.system.stiffness, phi.out(), force.out()));
  petsc::check(VecDuplicate(phi, inertia.out()));
  petsc::check(MatGetColumnVector(shapes, phi, 0));
  petsc::check(MatMult(body.system.stiffness, phi, force));
  petsc::check(MatMult(body.system.mass, phi, inertia));
  petsc::check(VecAXPY(force, -lambda, inertia));
  const Vec3 c{0, kSize[1] / 2, kSize[2] / 2};
  std::array<double, 6> residual{};
  const double* f = nullptr;
  petsc::check(VecGetArrayRead(force, &f));
  for (int i = 0; i < body.pieces.local.free_nodes; ++i) {
    Vec3 arm = body.pieces.local.nodes_m[i];
    for (int d = 0; d < 3; ++d) arm[d] -= c[d];
    for (int d = 0; d < 3; ++d) {
      const int e = (d + 1) % 3, g = (d + 2) % 3;
      residual[d] += f[3 * i + d];
      residual[3 + d] += arm[e] * f[3 * i + g] - arm[g] * f[3 * i + e];
    }
  }
  petsc::check(VecRestoreArrayRead(force, &f));
  MPI_Allreduce(MPI_IN_PLACE, residual.data(), 6, MPI_DOUBLE, MPI_SUM, kWorld);
  // Integrals over the box by a Gauss rule of degree 5 in each direction.
  std::array<double, 6> integral{};
  const double points[3] = {0.5 - std::sqrt(0.15), 0.5, 0.5 + std::sqrt(0.15)}, weights[3] = {5.0 / 18, 8.0 / 18, 5.0 / 18};
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      for (int k = 0; k < 3; ++k) {
        const Vec3 x{points[i] * kSize[0], points[j] * kSize[1], points[k] * kSize[2]};
        const double w = 7850 * weights[i] * weights[j] * weights[k] * kSize[0] * kSize[1] * kSize[2];
        const Vec3 u = used(x);
        for (int d = 0; d < 3; ++d) {
          const int e = (d + 1) % 3, g = (d + 2) % 3;
          integral[d] += w * u[d];
          integral[3 + d] += w * ((x[e] - c[e]) * u[g] - (x[g] - c[g]) * u[e]);
        }
      }
  double scale = 0.0;
  for (int k = 0; k < 6; ++k) scale = std::max(scale, std::abs(supports.reaction[k]));
  for (int k = 0; k < 6; ++k) EXPECT_NEAR(supports.reaction[k] + residual[k], -lambda * integral[k], 1e-10 * scale) << k;
}

TEST_P(Reactions, come_by_patches_that_no_element_joins) {
  const Body body(GetParam(), job::Mass::lumped, at_both_ends);
  const Supports supports = body.calc({[](const Vec3& x) { return Vec3{0, 0, x[0] * (kSize[0] - x[0])}; }}, {1e6});
  ASSERT_EQ(supports.list.size(), 2U);
  for (int s = 0; s < 2; ++s) {
    const Support& end = supports.list[s];
    EXPECT_EQ(end.entry, 0);
    EXPECT_NEAR(end.area_m2, kSize[1] * kSize[2], 1e-15);
    EXPECT_NEAR(end.thickness_m, kSize[2], 1e-12) << "the short side";
    EXPECT_NEAR(end.normal[0], s == 0 ? -1 : 1, 1e-12) << "out of the body";
    EXPECT_NEAR(end.centre_m[0], s == 0 ? 0 : kSize[0], 1e-15);
    EXPECT_NEAR(end.centre_m[1], kSize[1] / 2, 1e-15);
  }
  // The field is mirror-symmetric, the mesh is not: up to discretisation error, forces at the ends are equal and couples opposite.
  const double* r = supports.reaction.data();
  EXPECT_NEAR(r[2] / r[8], 1, 0.15);
  EXPECT_NEAR(r[4] / r[10], -1, 0.3);
}

TEST_P(Reactions, count_the_energy_of_elements_within_one_thickness) {
  const Body body(GetParam(), job::Mass::consistent, at_end);
  const std::vector<Field> fields{[](const Vec3& x) { return Vec3{x[0], 0, 0}; }};
  const double lambda = (kSteel.lame_lambda_pa() + 2 * kSteel.lame_mu_pa()) * kSize[0] * kSize[1] * kSize[2];  // phi^T K phi
  // Cells of 20 mm, thickness 20 mm: the first of fifteen, with its share of the energy of constant strain.
  EXPECT_NEAR(body.calc(fields, {lambda}).energy[0], 1.0 / 15, 1e-9);
}

TEST(Supports, of_a_free_body_are_none) {
  const Body body(1, job::Mass::consistent, nowhere);
  EXPECT_TRUE(body.calc({[](const Vec3& x) { return x; }}, {1.0}).list.empty());
}

TEST(Supports, of_two_entries_that_meet_stay_two_and_a_single_node_has_no_area) {
  const auto fix = [](const Vec3& x) {
    if (x[0] < 1e-9) return x[1] < kSize[1] / 2 - 1e-9 ? 1 : 0;
    return x[0] > kSize[0] - 1e-9 && x[1] < 1e-9 && x[2] < 1e-9 ? 2 : -1;
  };
  const Body body(1, job::Mass::consistent, fix);
  const Supports supports = body.calc({[](const Vec3& x) { return Vec3{x[0], 0, 0}; }}, {1e12});
  ASSERT_EQ(supports.list.size(), 3U);
  for (int s = 0; s < 3; ++s) EXPECT_EQ(supports.list[s].entry, s);
  EXPECT_EQ(supports.list[2].area_m2, 0.0);
  EXPECT_EQ(supports.list[2].thickness_m, 0.0);
  EXPECT_EQ(supports.list[2].normal, Vec3{});
  EXPECT_EQ(supports.list[2].centre_m, (Vec3{kSize[0], 0, 0}));
  for (int k = 3; k < 6; ++k) EXPECT_NEAR(supports.reaction[12 + k], 0.0, 1e-6) << "a point takes no couple";
  for (const double r : supports.reaction) EXPECT_TRUE(std::isfinite(r));
}

INSTANTIATE_TEST_SUITE_P(Orders, Reactions, testing::Values(1, 2));

}  // namespace
}  // namespace carillon::fem
