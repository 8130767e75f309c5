// Spectra's shift-and-invert Lanczos on Eigen's simplicial L D L^T: the modes of K and M that `carillon-precompute --matrices` writes, by
// code that shares nothing with ours.
//
//   others_spectra STIFFNESS.mtx MASS.mtx MODES SIGMA     prints the MODES eigenvalues next to SIGMA, ascending, one a line
#include <Spectra/MatOp/SparseSymMatProd.h>
#include <Spectra/SymGEigsShiftSolver.h>

#include <Eigen/Sparse>
#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <fstream>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

namespace {

using Sparse = Eigen::SparseMatrix<double>;

/// A symmetric coordinate file (Boisvert, Pozo, Remington 1996), both triangles.
Sparse read_matrix(const std::string& path) {
  std::ifstream file(path);
  std::string line;
  std::getline(file, line);
  if (line != "%%MatrixMarket matrix coordinate real symmetric")
    throw std::runtime_error(path + ": not a symmetric matrix of Matrix Market");
  while (file.peek() == '%') std::getline(file, line);
  long rows = 0, columns = 0, count = 0;
  file >> rows >> columns >> count;
  std::vector<Eigen::Triplet<double>> entries;
  long i = 0, j = 0;
  double value = 0;
  while (count-- > 0 && file >> i >> j >> value) {
    entries.emplace_back(i - 1, j - 1, value);
    if (i != j) entries.emplace_back(j - 1, i - 1, value);
  }
  if (count >= 0) throw std::runtime_error(path + ": ends too early");
  Sparse matrix(rows, columns);
  matrix.setFromTriplets(entries.begin(), entries.end());
  return matrix;
}

/// (K - sigma M)^-1, as Spectra asks for it.
class Inverse {
 public:
  using Scalar = double;
  Inverse(const Sparse& stiffness, const Sparse& mass) : stiffness_(stiffness), mass_(mass) {}
  Eigen::Index rows() const { return stiffness_.rows(); }
  Eigen::Index cols() const { return stiffness_.cols(); }
  void set_shift(double sigma) {
    shifted_ = stiffness_ - sigma * mass_;
    factor_.compute(shifted_);
    if (factor_.info() != Eigen::Success) throw std::runtime_error("K - sigma M has no L D L^T");
  }
  /// With one step of iterative refinement.
  void perform_op(const double* x, double* y) const {
    const Eigen::Map<const Eigen::VectorXd> right(x, rows());
    Eigen::VectorXd left = factor_.solve(right);
    left += factor_.solve(right - shifted_ * left);
    Eigen::Map<Eigen::VectorXd>(y, rows()) = left;
  }

 private:
  const Sparse &stiffness_, &mass_;
  Sparse shifted_;
  Eigen::SimplicialLDLT<Sparse> factor_;
};

void run(const std::vector<std::string>& words) {
  const Sparse stiffness = read_matrix(words.at(0)), mass = read_matrix(words.at(1));
  const Eigen::Index modes = std::stol(words.at(2));
  Inverse inverse(stiffness, mass);
  Spectra::SparseSymMatProd<double> product(mass);
  Spectra::SymGEigsShiftSolver<Inverse, Spectra::SparseSymMatProd<double>, Spectra::GEigsMode::ShiftInvert> solver(
      inverse, product, modes, std::min<Eigen::Index>(3 * modes + 20, stiffness.rows()), std::stod(words.at(3)));
  solver.init();
  solver.compute(Spectra::SortRule::LargestMagn, 1000, 1e-13, Spectra::SortRule::SmallestAlge);
  if (solver.info() != Spectra::CompInfo::Successful) throw std::runtime_error("Spectra did not converge");
  const Eigen::VectorXd found = solver.eigenvalues();
  std::vector<double> lambda(found.begin(), found.end());
  std::sort(lambda.begin(), lambda.end());
  for (const double value : lambda) std::printf("%.17g\n", value);
}

}  // namespace

int main(int argc, char** argv) {
  try {
    run({argv + 1, argv + argc});
  } catch (const std::exception& error) {
    std::fprintf(stderr, "others_spectra: %s\n", error.what());
    return 1;
  }
}
