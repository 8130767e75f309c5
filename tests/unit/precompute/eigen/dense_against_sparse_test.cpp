// Sparse solvers on a small finite-element body, against all eigenvalues of the same K and M as dense matrices by LAPACK (dsygv_, called
// here, independent of the code under test).
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include "precompute/eigen/solve_modes.hpp"
#include "precompute/fem/assemble.hpp"
#include "precompute/mesh/distributed/distribute.hpp"
#include "precompute/petsc/session.hpp"
#include "tests/support/box_mesh.hpp"

extern "C" void dsygv_(const int* type, const char* job, const char* half, const int* n, double* a, const int* lda, double* b,
                       const int* ldb, double* w, double* work, const int* lwork, int* info);

namespace carillon::eigen {
namespace {

const material::Material kSteel{.young_modulus_pa = 200e9, .poisson_ratio = 0.3, .density_kg_m3 = 7850, .alpha1_s = 0, .alpha2_per_s = 0};

std::vector<double> to_dense(Mat matrix, int n) {
  std::vector<double> dense(static_cast<std::size_t>(n) * n, 0.0);
  for (PetscInt row = 0; row < n; ++row) {
    PetscInt count = 0;
    const PetscInt* columns = nullptr;
    const PetscScalar* values = nullptr;
    petsc::check(MatGetRow(matrix, row, &count, &columns, &values));
    for (PetscInt i = 0; i < count; ++i) dense[static_cast<std::size_t>(columns[i]) * n + row] = values[i];
    petsc::check(MatRestoreRow(matrix, row, &count, &columns, &values));
  }
  return dense;
}

/// All eigenvalues of the pencil, ascending.
std::vector<double> calc_dense_eigenvalues(Mat stiffness, Mat mass) {
  PetscInt size = 0;
  petsc::check(MatGetSize(stiffness, &size, nullptr));
  const int n = size, type = 1, lwork = 64 * n;
  std::vector<double> k = to_dense(stiffness, n), m = to_dense(mass, n), lambda(n), work(lwork);
  int info = 0;
  dsygv_(&type, "N", "L", &n, k.data(), &n, m.data(), &n, lambda.data(), work.data(), &lwork, &info);
  EXPECT_EQ(info, 0);
  return lambda;
}

struct Case {
  const char* name;
  int order;
  job::Mass mass;
  Factorisation factorisation;
};
class Sparse : public testing::TestWithParam<Case> {};

TEST_P(Sparse, agrees_with_dense_lapack) {
  constexpr double kLowHz = 20.0, kHighHz = 40000.0;
  const mesh::TetMesh box =
      tests::make_box(GetParam().order == 1 ? std::array{9, 6, 3} : std::array{5, 3, 2}, {0.09, 0.05, 0.02}, GetParam().order);
  mesh::DistributedMesh pieces = mesh::distribute(PETSC_COMM_WORLD, box, {}, {.elimination_order = true});
  const fem::System system = fem::assemble(PETSC_COMM_WORLD, pieces.local, kSteel, GetParam().mass);
  std::vector<double> truth;
  for (const double lambda : calc_dense_eigenvalues(system.stiffness, system.mass)) {
    const double freq_hz = std::sqrt(std::max(lambda, 0.0)) / (2 * std::numbers::pi);
    if (freq_hz >= kLowHz && freq_hz <= kHighHz) truth.push_back(freq_hz);
  }
  NodeLayout layout;
  layout.nodes_m.assign(pieces.local.nodes_m.begin(), pieces.local.nodes_m.begin() + pieces.local.free_nodes);
  layout.component.assign(pieces.local.component.begin(), pieces.local.component.begin() + pieces.local.free_nodes);
  layout.component_count = pieces.components;
  layout.fixed = pieces.fixed_m;
  layout.elimination_position = pieces.elimination_position;
  Options options;
  options.low_hz = kLowHz;
  options.high_hz = kHighHz;
  options.factorisation = GetParam().factorisation;
  const Modes modes = solve_modes({system.stiffness, system.mass, layout}, options);
  EXPECT_EQ(modes.factor.solver.find("LAPACK"), std::string::npos) << modes.factor.solver;  // the sparse solver is tested
  ASSERT_GE(truth.size(), 5U);
  ASSERT_EQ(modes.lambda.size(), truth.size());
  for (std::size_t i = 0; i < truth.size(); ++i)
    EXPECT_NEAR(std::sqrt(modes.lambda[i]) / (2 * std::numbers::pi) / truth[i], 1.0, 1e-9) << i;
}

INSTANTIATE_TEST_SUITE_P(Table, Sparse,
                         testing::Values(Case{"T4_lumped_mumps", 1, job::Mass::lumped, Factorisation::kMumps},
                                         Case{"T4_consistent_ldlt", 1, job::Mass::consistent, Factorisation::kLdlt},
                                         Case{"T10_consistent_mumps", 2, job::Mass::consistent, Factorisation::kMumps},
                                         Case{"T10_consistent_ldlt", 2, job::Mass::consistent, Factorisation::kLdlt}),
                         [](const auto& info) { return info.param.name; });

}  // namespace
}  // namespace carillon::eigen
