// Method: Symmetric scaling to a unit diagonal by powers of two, which change no digit; one factor per node, so that pivoting sees rigid
// motions of a node unchanged; none if the diagonal spans less than six decades.
// Source: van der Sluis, Condition numbers and equilibration of matrices, Numer. Math. 14, 1969; Higham 2002, section 7.3.
#include "precompute/ldlt/equilibrated.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "precompute/petsc/diagonal.hpp"
#include "precompute/petsc/session.hpp"

namespace carillon::ldlt {
namespace {

using petsc::check;

constexpr double kWide = 1e6;  // Stiffest over softest node; well-shaped meshes of one material span three decades.

/// Largest diagonal entry of each own node. Collective.
std::vector<double> find_stiffness(const la::Pencil& pencil) {
  std::vector<double> largest = petsc::read_diagonal(pencil.stiffness);
  const std::size_t nodes = largest.size() / 3;
  for (std::size_t node = 0; node < nodes; ++node)
    largest[node] = pencil.stiffness_factor * std::max({largest[3 * node], largest[3 * node + 1], largest[3 * node + 2]});
  largest.resize(nodes);
  return largest;
}

/// Ratio of the stiffest to the softest node, of all nodes with stiffness; 0 if there is none. Collective.
double find_width(const comm::Communicator& comm, const std::vector<double>& stiffness) {
  std::array<double, 2> ends{0, 0};  // largest value, largest inverse
  for (const double k : stiffness)
    if (k > 0) ends = {std::max(ends[0], k), std::max(ends[1], 1 / k)};
  comm.max(ends);
  return ends[0] * ends[1];
}

}  // namespace

EquilibratedPencil::EquilibratedPencil(const la::Pencil& given) : pencil_(given) {
  const Mat stiffness = given.stiffness, mass = given.mass;
  const comm::Communicator comm = petsc::get_communicator(stiffness);
  const std::vector<double> node_stiffness = find_stiffness(given);
  const double width = find_width(comm, node_stiffness);
  if (!(width > kWide) || !std::isfinite(width)) return;
  petsc::VecHandle factor;
  check(MatCreateVecs(stiffness, nullptr, factor.out()));
  comm.agree([&] {  // Copies of this rank's rows: allocation may fail on one rank alone.
    factor_.resize(3 * node_stiffness.size());
    check(MatDuplicate(stiffness, MAT_COPY_VALUES, scaled_stiffness_.out()));
    check(MatDuplicate(mass, MAT_COPY_VALUES, scaled_mass_.out()));
  });
  for (std::size_t i = 0; i < factor_.size(); ++i) {
    const double k = node_stiffness[i / 3];
    factor_[i] = std::ldexp(1.0, k > 0 ? -static_cast<int>(std::lround(0.5 * std::log2(k))) : 0);
  }
  PetscScalar* values = nullptr;
  check(VecGetArray(factor, &values));
  std::copy(factor_.begin(), factor_.end(), values);
  check(VecRestoreArray(factor, &values));
  check(MatDiagonalScale(scaled_stiffness_, factor, factor));
  check(MatDiagonalScale(scaled_mass_, factor, factor));
  pencil_.stiffness = scaled_stiffness_;
  pencil_.mass = scaled_mass_;
}

void EquilibratedPencil::scale(double* x, int stride, int columns) const {
  if (factor_.empty()) return;
  for (int j = 0; j < columns; ++j)
    for (std::size_t i = 0; i < factor_.size(); ++i) x[std::ptrdiff_t{j} * stride + static_cast<std::ptrdiff_t>(i)] *= factor_[i];
}

}  // namespace carillon::ldlt
