// Method:     Symmetric scaling to a unit diagonal, in powers of two, which change no digit.
// Source:     van der Sluis, Condition numbers and equilibration of matrices, Numer. Math. 14, 1969; Higham 2002, section 7.3.
// Deviations: one factor per node, so that rigid motions of a node stay what they are to the pivots; none within six decades.
#include "precompute/ldlt/graded.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "precompute/petsc/diagonal.hpp"
#include "precompute/petsc/session.hpp"

namespace carillon::ldlt {
namespace {

using petsc::check;

constexpr double kWide = 1e6;  // Stiffest over softest node; meshes of one material, well shaped, span three decades.

/// Of every own node the largest of the diagonal. Collective.
std::vector<double> find_stiffness(Mat matrix) {
  const std::vector<double> diagonal = petsc::read_diagonal(matrix);
  std::vector<double> stiffness(diagonal.size() / 3);
  for (std::size_t node = 0; node < stiffness.size(); ++node)
    stiffness[node] = std::max({diagonal[3 * node], diagonal[3 * node + 1], diagonal[3 * node + 2]});
  return stiffness;
}

/// A copy of the matrix, or its values once more in the copy there is, scaled from both sides.
void copy_scaled(Mat from, Vec factor, petsc::MatHandle& to) {
  if (to)
    check(MatCopy(from, to, SAME_NONZERO_PATTERN));
  else
    check(MatDuplicate(from, MAT_COPY_VALUES, to.out()));
  check(MatDiagonalScale(to, factor, factor));
}

}  // namespace

void GradedPair::update() {
  const std::vector<double> stiffness = find_stiffness(given_stiffness_);
  std::array<double, 2> ends{0, 0};  // largest, and largest inverse
  for (const double k : stiffness)
    if (k > 0) ends = {std::max(ends[0], k), std::max(ends[1], 1 / k)};
  MPI_Comm comm = MPI_COMM_NULL;
  check(PetscObjectGetComm(reinterpret_cast<PetscObject>(given_stiffness_), &comm));
  MPI_Allreduce(MPI_IN_PLACE, ends.data(), 2, MPI_DOUBLE, MPI_MAX, comm);
  if (!(ends[0] * ends[1] > kWide) || !std::isfinite(ends[0] * ends[1])) {
    scaled_stiffness_.reset();
    scaled_mass_.reset();
    factor_.clear();
    return;
  }
  factor_.resize(3 * stiffness.size());
  for (std::size_t i = 0; i < factor_.size(); ++i) {
    const double k = stiffness[i / 3];
    factor_[i] = std::ldexp(1.0, k > 0 ? -static_cast<int>(std::lround(0.5 * std::log2(k))) : 0);
  }
  petsc::VecHandle factor;
  check(MatCreateVecs(given_stiffness_, nullptr, factor.out()));
  PetscScalar* values = nullptr;
  check(VecGetArray(factor, &values));
  std::copy(factor_.begin(), factor_.end(), values);
  check(VecRestoreArray(factor, &values));
  copy_scaled(given_stiffness_, factor, scaled_stiffness_);
  copy_scaled(given_mass_, factor, scaled_mass_);
}

void GradedPair::scale(double* x, int stride, int columns) const {
  if (factor_.empty()) return;
  for (int j = 0; j < columns; ++j)
    for (std::size_t i = 0; i < factor_.size(); ++i) x[std::ptrdiff_t{j} * stride + static_cast<std::ptrdiff_t>(i)] *= factor_[i];
}

}  // namespace carillon::ldlt
