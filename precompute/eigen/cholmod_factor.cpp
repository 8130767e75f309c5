// Method:     Supernodal L L^T of K - sigma M on one rank, sigma < 0, by CHOLMOD through PETSc.
// Source:     Chen, Davis, Hager, Rajamanickam, Algorithm 887: CHOLMOD, ACM TOMS 35(3), 2008.
// Deviations: none.
#include <fmt/core.h>

#include <algorithm>
#include <vector>

#include "precompute/eigen/shifted_factor.hpp"
#include "precompute/petsc/handle.hpp"
#include "precompute/petsc/session.hpp"
#include "runtime/base/error.hpp"

namespace carillon::eigen {
namespace {

using petsc::check;

class CholmodFactor final : public ShiftedFactor {
 public:
  CholmodFactor(const la::Pencil& pencil, const std::vector<std::int32_t>& elimination_position) : pencil_(pencil) {
    PetscInt n = 0;
    check(MatGetSize(pencil.stiffness, &n, nullptr));
    is_given_ = !elimination_position.empty();
    if (is_given_) {
      std::vector<PetscInt> pivot_rows(n);
      for (std::size_t node = 0; node < elimination_position.size(); ++node) {
        const std::size_t place = 3 * elimination_position[node];
        for (std::size_t d = 0; d < 3; ++d) pivot_rows[place + d] = static_cast<PetscInt>(3 * node + d);
      }
      check(ISCreateGeneral(PETSC_COMM_SELF, n, pivot_rows.data(), PETSC_COPY_VALUES, order_.out()));
      check(ISSetPermutation(order_));
    }
  }

  bool factorise(double sigma) override {
    if (sigma >= 0)
      throw SolveError(fmt::format("CHOLMOD was asked for K - sigma M at sigma = {:.9g}, which is not positive definite.", sigma));
    MatFactorInfo info;
    check(MatFactorInfoInitialize(&info));
    info.fill = 5;
    check(MatDuplicate(pencil_.stiffness, MAT_COPY_VALUES, shifted_.out()));
    check(MatScale(shifted_, pencil_.stiffness_factor));
    check(MatAXPY(shifted_, -sigma * pencil_.mass_factor, pencil_.mass, UNKNOWN_NONZERO_PATTERN));
    check(MatSetOption(shifted_, MAT_SPD, PETSC_TRUE));
    // PETSc hands CHOLMOD its settings through the options of this process alone: supernodal, and nothing but the order that is given.
    check(PetscOptionsSetValue(nullptr, "-mat_cholmod_factor", "SUPERNODAL"));
    if (is_given_) check(PetscOptionsSetValue(nullptr, "-mat_cholmod_nmethods", "1"));
    const PetscErrorCode got = MatGetFactor(shifted_, MATSOLVERCHOLMOD, MAT_FACTOR_CHOLESKY, factor_.out());
    check(PetscOptionsClearValue(nullptr, "-mat_cholmod_factor"));
    if (is_given_) check(PetscOptionsClearValue(nullptr, "-mat_cholmod_nmethods"));
    check(got);
    check(MatCholeskyFactorSymbolic(factor_, shifted_, order_, &info));
    check(MatCholeskyFactorNumeric(factor_, shifted_, &info));
    shifted_.reset();
    return true;
  }

  void solve(const double* b, double* x, std::ptrdiff_t stride, int columns) override {
    PetscInt n = 0;
    check(MatGetSize(pencil_.stiffness, &n, nullptr));
    for (int j = 0; j < columns && b != x; ++j) std::copy_n(b + j * stride, n, x + j * stride);
    petsc::MatHandle solution;
    petsc::MatHandle right;
    check(MatCreateSeqDense(PETSC_COMM_SELF, n, columns, x, solution.out()));
    check(MatDenseSetLDA(solution, petsc::to_petsc_int(stride)));
    check(MatDuplicate(solution, MAT_COPY_VALUES, right.out()));
    check(MatMatSolve(factor_, right, solution));
  }
  std::int64_t get_negative_pivots() const override { return 0; }  // K - sigma M is positive definite.
  double get_backward_error() const override { return 0; }
  std::int64_t get_peak_bytes() const override { return 0; }

  std::string get_solver() const override { return "CHOLMOD L L^T"; }
  std::string get_ordering() const override { return is_given_ ? "METIS nested dissection (given)" : "CHOLMOD's choice"; }

  std::int64_t get_entries() const override {
    MatInfo info;
    if (factor_.get() == nullptr || MatGetInfo(factor_, MAT_GLOBAL_SUM, &info) != 0) return 0;
    return static_cast<std::int64_t>(info.nz_used);
  }
  double get_flops() const override { return 0; }

 private:
  la::Pencil pencil_;
  bool is_given_ = false;
  petsc::IsHandle order_;
  petsc::MatHandle shifted_;
  petsc::MatHandle factor_;
};

}  // namespace

std::unique_ptr<ShiftedFactor> make_cholmod_factor(const la::Pencil& pencil, const std::vector<std::int32_t>& elimination_position) {
  return std::make_unique<CholmodFactor>(pencil, elimination_position);
}

}  // namespace carillon::eigen
