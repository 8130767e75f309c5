// Method: Rayleigh quotients, residuals and Gram matrix by matrix-matrix products; Gram-Schmidt as Cholesky of the Gram matrix.
// Source: Parlett, The symmetric eigenvalue problem, 1998, section 4.5 (a residual bounds the error of its eigenvalue); Golub, Van Loan,
// Matrix Computations, sections 2.7 (rounding of products) and 5.2 (orthonormal bases).
#include "precompute/eigen/check_modes.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <tuple>

#include "precompute/eigen/mode_sums.hpp"
#include "precompute/la/lapack.hpp"
#include "precompute/la/local_columns.hpp"
#include "precompute/petsc/diagonal.hpp"
#include "precompute/petsc/session.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/sort_order.hpp"

namespace carillon::eigen {
namespace {

using petsc::check;

constexpr double kTieTolerance = 1e-4;  // Far above the errors of shapes, so that rounding breaks no tie.
constexpr double kRoundOff = 10;        // Refined modes of thin shells reach 1 to 2.
using la::LocalColumns;
using la::NodeMatrix;
using Row = NodeMatrix::Row;
constexpr int kStrip = NodeMatrix::kStrip;
constexpr int kWide =
    2 * kStrip;                 // Columns at a time in a Gram matrix: the width that block_kernels.hpp handles without packing the others.
constexpr double kNear = 1e-4;  // Relative to lambda: largest difference that is accurate enough to measure a residual.

// Upper triangle of Phi^T M Phi, summed over the ranks; calc_mass_product(first, m_phi) writes M times the columns from `first` on.
template <class CalcMassProduct>
la::Matrix calc_gram(const comm::Communicator& comm, const Columns& phi, const CalcMassProduct& calc_mass_product) {
  la::Matrix gram = la::Matrix::Zero(phi.count, phi.count);
  std::vector<double> space(static_cast<std::size_t>(phi.rows) * kWide);
  for (int first = 0; first < phi.count; first += kWide) {
    const Columns m_phi{space.data(), phi.rows, phi.rows, std::min(kWide, phi.count - first)};
    calc_mass_product(first, m_phi);
    multiply_transposed(phi.part(0, first + m_phi.count), m_phi, gram.col(first).data(), phi.count);
  }
  comm.sum(la::entries(gram));
  return gram;
}

// K and M times columns first ... first + 15 of phi, a few nodes at a time: sums and M phi.
void multiply_and_sum(const Operators& operators, const Columns& phi, int first, const Row& lambda, std::vector<Row>& packed,
                      std::vector<Row>& packed_for_mass, Sums& total, const Columns& m_phi) {
  constexpr std::size_t kNodes = 32;
  Row m_rows[3 * kNodes];
  Row k_rows[3 * kNodes];
  operators.stiffness.pack(phi, first, packed);
  if (!operators.mass.is_diagonal()) operators.mass.pack(phi, first, packed_for_mass);
  const std::vector<Row>& for_mass = operators.mass.is_diagonal() ? packed : packed_for_mass;
  total = {};
  const std::size_t nodes = phi.rows / 3;
  for (std::size_t node = 0; node < nodes; node += kNodes) {
    const std::size_t count = std::min(kNodes, nodes - node);
    operators.stiffness.multiply_rows(packed.data(), node, count, k_rows);
    operators.mass.multiply_rows(for_mass.data(), node, count, m_rows);
    add_sums(3 * count, packed.data() + 3 * node, m_rows, k_rows, operators.stiffness_diagonal.data() + 3 * node, lambda, total);
    NodeMatrix::unpack(m_rows, node, count, m_phi);
  }
  operators.comm.sum(std::span(reinterpret_cast<double*>(total.data()), kSums * kStrip));
}

}  // namespace

Operators::Operators(const la::Pencil& pencil)
    : stiffness(pencil.stiffness, pencil.stiffness_factor),
      mass(pencil.mass, pencil.mass_factor),
      stiffness_diagonal(petsc::read_diagonal(pencil.stiffness)),
      mass_diagonal(petsc::read_diagonal(pencil.mass)),
      comm(petsc::get_communicator(pencil.stiffness)) {
  for (double& x : stiffness_diagonal) x *= pencil.stiffness_factor;
  for (double& x : mass_diagonal) x *= pencil.mass_factor;
}

// The residual uses a given lambda': r = (K - lambda' M) phi - delta M phi, delta = lambda - lambda'. Its norm loses nothing to
// cancellation while delta is small; otherwise the sums are repeated.
ModeErrors normalise_and_measure(const Operators& operators, std::vector<double>& lambda, Mat shapes) {
  const std::size_t modes = lambda.size();
  ModeErrors errors;
  if (modes == 0) return errors;
  const LocalColumns access(shapes);
  const Columns phi = access.view();
  const std::size_t rows = phi.rows;
  std::vector<Row> packed, packed_for_mass;
  std::vector<double> square(modes);  // phi^T M phi
  const la::Matrix gram = calc_gram(operators.comm, phi, [&](int wide, const Columns& m_phi) {
    for (int first = wide; first < wide + m_phi.count; first += kStrip) {
      const int width = std::min(kStrip, phi.count - first);
      Row near{};
      std::copy_n(lambda.data() + first, width, near.column);
      Sums sums;
      const auto calc_delta = [&](int c) { return sums[kPhiR].column[c] / sums[kPhiMPhi].column[c]; };
      constexpr int kMoreTries = 2;
      for (int i = 0;; ++i) {
        multiply_and_sum(operators, phi, first, near, packed, packed_for_mass, sums, m_phi.part(first - wide, width));
        bool is_near = true;
        for (int c = 0; c < width; ++c) is_near = is_near && std::abs(calc_delta(c)) <= kNear * std::abs(near.column[c] + calc_delta(c));
        if (is_near || i == kMoreTries) break;
        for (int c = 0; c < width; ++c) near.column[c] += calc_delta(c);
      }
      for (int c = 0; c < width; ++c) {
        const std::size_t j = first + c;
        const double delta = calc_delta(c);
        const double residual = sums[kRR].column[c] - 2 * delta * sums[kRMPhi].column[c] + delta * delta * sums[kMPhiMPhi].column[c];
        square[j] = sums[kPhiMPhi].column[c];
        lambda[j] = near.column[c] + delta;
        const double scale = lambda[j] * std::sqrt(sums[kMPhiMPhi].column[c]);
        errors.residual.push_back(std::sqrt(std::max(residual, 0.0)) / scale);
        errors.floor.push_back(kRoundOff * PETSC_MACHINE_EPSILON * std::sqrt(sums[kDiagonal].column[c]) / scale);
      }
    }
  });
  for (std::size_t j = 0; j < modes; ++j) {
    for (std::size_t i = 0; i < j; ++i)
      errors.orthonormality = std::max(errors.orthonormality, std::abs(gram(i, j)) / std::sqrt(square[i] * square[j]));
    const double factor = 1 / std::sqrt(square[j]);
    double* column = phi.column(static_cast<int>(j));
    for (std::size_t i = 0; i < rows; ++i) column[i] *= factor;
  }
  return errors;
}

void sort_modes(std::vector<double>& lambda, Mat shapes, ModeErrors& errors) {
  if (std::is_sorted(lambda.begin(), lambda.end())) return;
  const std::vector<std::size_t> order = base::find_sort_order(lambda);
  for (std::vector<double>* values : {&lambda, &errors.residual, &errors.floor}) {
    const std::vector<double> old = *values;
    for (std::size_t j = 0; j < order.size(); ++j) (*values)[j] = old[order[j]];
  }
  const LocalColumns columns(shapes);
  permute_columns(columns.view(), order);
}

void orthonormalise_shapes(const Operators& operators, Mat shapes) {
  const LocalColumns access(shapes);
  const Columns phi = access.view();
  la::Matrix gram = calc_gram(operators.comm, phi,
                              [&](int first, const Columns& m_phi) { operators.mass.multiply(phi.part(first, m_phi.count), m_phi); });
  const int info = la::factorise_cholesky(gram);
  if (info != 0)
    throw SolveError(fmt::format("Mode {} is a combination of lower ones: the same mode converged twice. Solve the band in parts.", info));
  la::solve_upper_from_right(phi.rows, phi.count, gram.data(), phi.count, phi.values, phi.stride);
}

void orient_shapes(Mat shapes, const std::vector<Vec3>& nodes_m) {
  const comm::Communicator comm = petsc::get_communicator(shapes);
  const LocalColumns phi(shapes);
  const std::size_t modes = phi.columns;
  std::vector<double> largest(modes, 0.0);
  for (std::size_t j = 0; j < modes; ++j) {
    const double* column = phi.column(static_cast<PetscInt>(j));
    double lanes[8] = {};
    PetscInt i = 0;
    for (; i + 8 <= phi.rows; i += 8) {
      for (PetscInt lane = 0; lane < 8; ++lane) lanes[lane] = std::max(lanes[lane], std::abs(column[i + lane]));
    }
    for (; i < phi.rows; ++i) lanes[0] = std::max(lanes[0], std::abs(column[i]));
    largest[j] = *std::max_element(lanes, lanes + 8);
  }
  comm.max(largest);

  // First candidate of each rank by (x, y, z, axis), gathered on all ranks.
  using Candidate = std::array<double, 5>;  // x, y, z, axis, entry; entry 0: none
  std::vector<Candidate> mine(modes, Candidate{0, 0, 0, 0, 0});
  const auto comes_first = [](const Candidate& a, const Candidate& b) {
    if ((a[4] != 0) != (b[4] != 0)) return a[4] != 0;
    return std::tie(a[0], a[1], a[2], a[3]) < std::tie(b[0], b[1], b[2], b[3]);
  };
  for (std::size_t j = 0; j < modes; ++j) {
    const double* column = phi.column(static_cast<PetscInt>(j));
    for (PetscInt i = 0; i < phi.rows; ++i) {
      if (std::abs(column[i]) < (1 - kTieTolerance) * largest[j]) continue;
      const Vec3& x = nodes_m[i / 3];
      const Candidate candidate{x[0], x[1], x[2], static_cast<double>(i % 3), column[i]};
      if (comes_first(candidate, mine[j])) mine[j] = candidate;
    }
  }
  const std::vector<Candidate> all = comm.all_gather(mine);
  for (std::size_t j = 0; j < modes; ++j) {
    Candidate first = all[j];
    for (std::size_t r = 1; r < static_cast<std::size_t>(comm.size()); ++r) {
      if (comes_first(all[r * modes + j], first)) first = all[r * modes + j];
    }
    if (first[4] >= 0) continue;
    double* column = phi.column(static_cast<PetscInt>(j));
    for (PetscInt i = 0; i < phi.rows; ++i) column[i] = -column[i];
  }
}

}  // namespace carillon::eigen
