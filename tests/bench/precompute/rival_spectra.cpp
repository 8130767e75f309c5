// SymGEigsShiftSolver of Spectra with two operators: SimplicialLDLT of Eigen, and the supernodal factor of CHOLMOD. Spectra's own
// SymShiftInvert uses SparseLU of Eigen, which is slower than either.
#include <Spectra/MatOp/SparseSymMatProd.h>
#include <Spectra/SymGEigsShiftSolver.h>
#include <fmt/core.h>

#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cstring>
#include <memory>

#include "tests/bench/precompute/cholmod_operator.hpp"

namespace {

using Sparse = Eigen::SparseMatrix<double, Eigen::ColMajor, int>;
using View = Eigen::Map<const Sparse>;

View view(const bench::Matrix& matrix) {
  return {matrix.n, matrix.n, matrix.nnz, matrix.first.data(), matrix.column.data(), matrix.value.data()};
}

/// Operator interface required by Spectra.
class SimplicialOperator {
 public:
  using Scalar = double;
  SimplicialOperator(const bench::Matrix& stiffness, const bench::Matrix& mass, bench::Phases& phases)
      : stiffness_(view(stiffness)), mass_(view(mass)), phases_(phases) {}
  Eigen::Index rows() const { return stiffness_.rows(); }
  Eigen::Index cols() const { return stiffness_.cols(); }
  void set_shift(double sigma) {
    factor_.compute(stiffness_ - sigma * mass_);
    bench::demand(factor_.info() == Eigen::Success, "SimplicialLDLT: no factor");
  }
  void perform_op(const double* x, double* y) const {
    phases_.end("orthogonalise");
    Eigen::Map<Eigen::VectorXd>(y, rows()).noalias() = factor_.solve(Eigen::Map<const Eigen::VectorXd>(x, rows()));
    phases_.end("solve");
    ++solves;
  }
  mutable int solves = 0;

 private:
  Sparse stiffness_;
  Sparse mass_;
  bench::Phases& phases_;
  Eigen::SimplicialLDLT<Sparse, Eigen::Lower, Eigen::AMDOrdering<int>> factor_;
};

class SupernodalOperator {
 public:
  using Scalar = double;
  SupernodalOperator(const bench::Matrix& stiffness, const bench::Matrix& mass, bench::Phases& phases)
      : stiffness_(stiffness), mass_(mass), phases_(phases) {}
  Eigen::Index rows() const { return stiffness_.n; }
  Eigen::Index cols() const { return stiffness_.n; }
  void set_shift(double sigma) { inverse_ = std::make_unique<bench::CholmodOperator>(stiffness_, mass_, sigma); }
  void perform_op(const double* x, double* y) const {
    phases_.end("orthogonalise");
    inverse_->solve(x, y);
    phases_.end("solve");
    ++solves;
  }
  mutable int solves = 0;

 private:
  const bench::Matrix& stiffness_;
  const bench::Matrix& mass_;
  bench::Phases& phases_;
  std::unique_ptr<bench::CholmodOperator> inverse_;
};

template <class Operator>
void run(const bench::Arguments& arguments) {
  bench::Phases phases;
  const bench::Matrix stiffness = bench::read_matrix(arguments.stiffness);
  const bench::Matrix mass = bench::read_matrix(arguments.mass);
  phases.end("read");
  Operator inverse(stiffness, mass, phases);
  const Sparse mass_eigen = view(mass);
  Spectra::SparseSymMatProd<double> product(mass_eigen);
  const auto n = static_cast<Eigen::Index>(stiffness.n);
  Spectra::SymGEigsShiftSolver<Operator, Spectra::SparseSymMatProd<double>, Spectra::GEigsMode::ShiftInvert> solver(
      inverse, product, arguments.modes, std::min<Eigen::Index>(2 * arguments.modes, n), arguments.sigma);
  phases.end("factor");
  solver.init();
  const auto found = solver.compute(Spectra::SortRule::LargestMagn, 1000, arguments.tolerance, Spectra::SortRule::SmallestAlge);
  bench::demand(solver.info() == Spectra::CompInfo::Successful && found >= arguments.modes,
                fmt::format("{} of {} converged", found, arguments.modes));
  const Eigen::VectorXd lambda = solver.eigenvalues();
  const Eigen::MatrixXd vectors = solver.eigenvectors();
  phases.end("orthogonalise");
  bench::write_answer(arguments.answer, n, {lambda.data(), lambda.data() + lambda.size()}, vectors.data());
  phases.end("write");
  phases.count("solves", inverse.solves);
  phases.write(arguments.phases);
}

}  // namespace

int main(int argc, char** argv) {
  try {
    const bench::Arguments arguments = bench::parse_arguments(argc, argv);
    const bool is_supernodal = argc > 8 && std::strcmp(argv[8], "supernodal") == 0;
    is_supernodal ? run<SupernodalOperator>(arguments) : run<SimplicialOperator>(arguments);
  } catch (const std::exception& error) {
    fmt::print(stderr, "rival_spectra: {}\n", error.what());
    return 3;
  }
}
