// Method:     The three-term recurrence is followed by one projection, against the whole basis only where orthogonality is about to be lost
//             (orthogonality.cpp); the block is orthonormalised by Cholesky QR, twice if it is badly conditioned, and column by column,
//             with random columns for dependent ones, if it is singular.
// Source:     Grimes, Lewis, Simon, A shifted block Lanczos algorithm, SIAM J. Matrix Anal. Appl. 15(1), 1994. Yamamoto et al., Roundoff
//             error analysis of the CholeskyQR2 algorithm, ETNA 44, 2015.
// Deviations: none.
#include "precompute/eigen/orthogonaliser.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "precompute/comm/communicator.hpp"
#include "precompute/petsc/noise.hpp"

namespace carillon::eigen {
namespace {

constexpr double kWellConditioned = 1e-2;  // Smallest pivot of the scaled Gram matrix that needs no second Cholesky QR,
constexpr double kDependent = 1e-11;       // and smallest that Cholesky QR is trusted with.
constexpr double kReproject = 1e-2;        // A projection that takes more of a column's square is done once more.

// One rank decides for all.
template <std::size_t count>
void take_from_first(const comm::Communicator& comm, std::array<int, count>& values) {
  comm.broadcast_into(std::span<int>(values));
}

// 1 on the diagonal of a positive definite matrix. False where it is not one.
bool scale_to_unit_diagonal(la::Matrix& gram, la::Vector& scale) {
  scale.resize(gram.rows());
  for (Eigen::Index i = 0; i < gram.rows(); ++i) {
    scale[i] = std::sqrt(gram(i, i));
    if (!(scale[i] > 0) || !std::isfinite(scale[i])) return false;
  }
  for (Eigen::Index j = 0; j < gram.cols(); ++j) {
    for (Eigen::Index i = 0; i < gram.rows(); ++i) gram(i, j) /= scale[i] * scale[j];
  }
  return true;
}

}  // namespace

Orthogonaliser::Orthogonaliser(InnerProduct& inner, LanczosBasis& basis, const LockedModes& locked, std::vector<double> theta, PetscInt n,
                               PetscInt first_row, LanczosCheckpoint* checkpoint)
    : inner_(inner), basis_(basis), locked_(locked), n_(n), first_row_(first_row), checkpoint_(checkpoint), deflation_(std::move(theta)) {}

void Orthogonaliser::reset() {
  estimate_.reset();
  deflation_.reset();
}

int Orthogonaliser::start() {
  project(nullptr);
  return static_cast<int>(orthonormalise().rows());
}

void Orthogonaliser::step() {
  la::Matrix alpha;
  project(&alpha);
  basis_.set_diagonal(alpha);
  la::Matrix r = orthonormalise();
  if (r.rows() == basis_.width() && !confirm(r)) r = reproject(r);
  estimate_.advance(here(), r, is_skipped_);
  deflation_.advance(here(), r, projected_);
  for (int j = static_cast<int>(r.rows()); j < basis_.block(); ++j) {
    std::fill_n(inner_.w().column(j), inner_.w().rows, 0.0);
    std::fill_n(inner_.z().column(j), inner_.z().rows, 0.0);
  }
  basis_.set_coupling(std::move(r));
}

// w -= V_{j-1} R_{j-1}^T + V_j alpha; Z still is M V_j. Returns alpha.
la::Matrix Orthogonaliser::subtract_recurrence(const Columns& next) {
  const int width = basis_.width(), previous = basis_.previous(), coupled = basis_.size() - previous;
  const la::Matrix alpha = inner_.calc_products(inner_.z().part(0, width), next);
  la::Matrix local(coupled, width);
  local.topRows(coupled - width) = basis_.t().block(previous, basis_.size() - width, coupled - width, width);
  local.bottomRows(width) = alpha;
  la::subtract_product(basis_.columns(previous, coupled), local.data(), coupled, next);
  return alpha;
}

// What is projected out in this step.
void Orthogonaliser::decide(const la::Matrix& alpha) {
  is_skipped_ = estimate_.can_skip_reorthogonalisation(here(), alpha);
  projected_ = deflation_.find_columns_to_project(here(), alpha);
  std::array<int, 3> decision{is_skipped_ ? 1 : 0, projected_.first, projected_.count};
  take_from_first(inner_.comm(), decision);
  is_skipped_ = decision[0] != 0;
  projected_ = {decision[1], decision[2]};
}

la::Matrix Orthogonaliser::calc_products_and_vote(const Columns& against, const Columns& next_mass) {
  if (checkpoint_ == nullptr) return inner_.calc_products(against, next_mass);
  const CheckpointRequest own = checkpoint_->ask();
  std::array<double, 2> votes{own.stop ? 1.0 : 0.0, own.save ? 1.0 : 0.0};
  la::Matrix products = inner_.calc_products(against, next_mass, votes);
  request_.stop = request_.stop || votes[0] > 0;
  request_.save = request_.save || votes[1] > 0;
  return products;
}

// w -= (everything so far) (everything so far)^T M w, after the recurrence has taken the bulk away; where little is predicted to be left,
// only the blocks that the recurrence couples to. alpha: (width, width) the diagonal block; null for the first block.
void Orthogonaliser::project(la::Matrix* alpha) {
  const bool is_first = alpha == nullptr;
  const Columns next = inner_.w().part(0, count());
  const Columns next_mass = inner_.z().part(0, next.count);
  is_skipped_ = false;
  projected_ = deflation_.all();
  if (!is_first) {
    *alpha = subtract_recurrence(next);
    decide(*alpha);
  }
  const int width = basis_.width(), fixed = basis_.fixed().count;
  const Columns against = is_skipped_ ? basis_.columns(basis_.previous(), basis_.size() - basis_.previous()) : basis_.fixed_and_basis();
  const int stride = against.count + next.count;  // w follows them in memory, and its squares come with the products
  for (int pass = 0; pass < 3; ++pass) {
    inner_.multiply();
    const la::Matrix c = calc_products_and_vote(against.part(0, stride), next_mass);
    const la::Matrix parts = locked_.project_out(inner_.comm(), projected_, next, next_mass);
    if (pass == 0 && !is_first) deflation_.update_noise(projected_, parts);
    if (is_skipped_ && fixed > 0) la::subtract_product(basis_.fixed(), inner_.calc_products(basis_.fixed(), next_mass).data(), fixed, next);
    la::subtract_product(against, c.data(), stride, next);
    if (pass == 0 && !is_first && !is_skipped_) estimate_.update_noise(here(), c.data() + fixed, stride);
    double taken = 0;  // largest part of a column that this pass took away; its rounding is what it leaves behind
    double largest = 0;
    for (int j = 0; j < next.count; ++j) {
      const double* column = c.col(j).data();
      if (!is_first) {
        for (int i = 0; i < width; ++i) (*alpha)(i, j) += column[against.count - width + i];
      }
      const double part = std::inner_product(column, column + against.count, column, 0.0);
      taken = std::max(taken, part / column[against.count + j]);
      largest = std::max(largest, part);
    }
    if (!is_skipped_) estimate_.record_projection(std::sqrt(largest));
    estimate_.record_deflation(deflation_.calc_returned(projected_, parts));
    if (taken < kReproject) break;
  }
}

bool Orthogonaliser::confirm(const la::Matrix& r) const {
  std::array<int, 1> is_good{estimate_.is_confirmed(here(), r, is_skipped_) && deflation_.is_confirmed(here(), r) ? 1 : 0};
  take_from_first(inner_.comm(), is_good);
  return is_good[0] != 0;
}

// The projection that a step has skipped, or another two passes, of the block that came of it with R = before. What they take away is
// rounding of the operator. Returns the R of both.
la::Matrix Orthogonaliser::reproject(const la::Matrix& before) {
  is_skipped_ = false;
  estimate_.record_projection(0);
  estimate_.record_deflation(0);
  projected_ = deflation_.all();
  const Columns next = inner_.w().part(0, basis_.width());
  const Columns next_mass = inner_.z().part(0, basis_.width());
  const Columns all = basis_.fixed_and_basis();
  for (int pass = 0; pass < 2; ++pass) {
    inner_.multiply();
    (void)locked_.project_out(inner_.comm(), projected_, next, next_mass);
    la::subtract_product(all, inner_.calc_products(all, next_mass).data(), all.count, next);
  }
  const la::Matrix r = orthonormalise();
  la::Matrix product = la::Matrix::Zero(r.rows(), before.cols());
  for (Eigen::Index j = 0; j < before.cols(); ++j) {
    for (Eigen::Index k = 0; k < before.rows(); ++k) {
      for (Eigen::Index i = 0; i < r.rows(); ++i) product(i, j) += r(i, k) * before(k, j);
    }
  }
  return product;
}

// Makes the columns of w M-orthonormal: w <- w R^-1, z <- M w. Returns R: as many rows as columns are left, fewer than there were when the
// space is exhausted.
la::Matrix Orthogonaliser::orthonormalise() {
  inner_.multiply();
  la::Matrix r;
  if (basis_.size() + count() <= free_dimension() && orthonormalise_by_cholesky(r)) return r;
  return orthonormalise_by_columns();
}

bool Orthogonaliser::orthonormalise_by_cholesky(la::Matrix& r) {
  const int n = count();
  const Columns w = inner_.w().part(0, n);
  const Columns z = inner_.z().part(0, n);
  r = la::Matrix::Identity(n, n);
  for (int pass = 0; pass < 3; ++pass) {
    la::Matrix gram = inner_.calc_products(w, z);
    la::Vector scale;
    if (!scale_to_unit_diagonal(gram, scale) || la::factorise_cholesky(gram) != 0) return false;
    double smallest = 1;
    for (int i = 0; i < n; ++i) smallest = std::min(smallest, gram(i, i) * gram(i, i));
    if (pass == 0 && smallest < kDependent) return false;
    for (int j = 0; j < n; ++j) {
      for (int i = 0; i <= j; ++i) gram(i, j) *= scale[j];
      for (int i = j + 1; i < n; ++i) gram(i, j) = 0;
    }
    la::Matrix inverse = gram;
    if (la::invert_upper(inverse) != 0) return false;
    la::combine_columns(w, inverse.data(), n);
    la::combine_columns(z, inverse.data(), n);
    la::Matrix product = la::Matrix::Zero(n, n);
    la::gemm(la::Transpose::kNo, n, n, n, 1, gram.data(), n, r.data(), n, 0, product.data(), n);
    r = product;
    if (smallest > kWellConditioned) break;
  }
  return true;
}

// Column i of w against the basis, the deflated vectors and the columns before it, twice; coefficients (i) of the last. Its M-norm, zero if
// next to nothing is left.
double Orthogonaliser::orthogonalise_column(int i, double* coefficients) {
  const Columns all = basis_.fixed_and_basis();
  const Columns column = inner_.w().part(i, 1);
  const Columns image = inner_.z().part(i, 1);
  inner_.multiply();
  const double before = std::sqrt(inner_.calc_products(column, image)(0, 0));
  for (int pass = 0; pass < 2; ++pass) {
    if (pass > 0) inner_.multiply();
    (void)locked_.project_out(inner_.comm(), locked_.all(), column, image);
    la::subtract_product(all, inner_.calc_products(all, image).data(), all.count, column);
    if (i > 0) {
      const la::Matrix c = inner_.calc_products(inner_.w().part(0, i), image);
      la::subtract_product(inner_.w().part(0, i), c.data(), i, column);
      for (int k = 0; k < i; ++k) coefficients[k] += c(k, 0);
    }
  }
  inner_.multiply();
  const double after = std::sqrt(std::max(inner_.calc_products(column, image)(0, 0), 0.0));
  if (!(after > kDependent * before)) return 0;
  for (std::ptrdiff_t row = 0; row < column.rows; ++row) column.values[row] /= after;
  return after;
}

// A random vector, orthogonal to everything, as column i. False where none is found.
bool Orthogonaliser::fill_at_random(int i) {
  constexpr int kAttempts = 3;
  const Columns column = inner_.w().part(i, 1);
  for (int attempt = 0; attempt < kAttempts; ++attempt) {
    ++random_columns_;
    for (std::ptrdiff_t row = 0; row < column.rows; ++row)
      column.values[row] = petsc::make_noise(random_columns_, static_cast<std::uint64_t>(first_row_ + row));
    la::Vector ignored = la::Vector::Zero(count());
    if (orthogonalise_column(i, ignored.data()) > 0) return true;
  }
  return false;
}

la::Matrix Orthogonaliser::orthonormalise_by_columns() {
  const int n = count();
  const Columns w = inner_.w();
  const auto left = static_cast<int>(std::min<PetscInt>(n, free_dimension() - basis_.size()));
  double scale = 0;  // of the operator on the block: what is small against it is rounding
  for (int j = 0; j < n; ++j)
    scale = std::max(scale, std::sqrt(std::max(inner_.calc_products(w.part(j, 1), inner_.z().part(j, 1))(0, 0), 0.0)));
  la::Matrix full = la::Matrix::Zero(n, n);
  int kept = 0;
  for (int j = 0; j < n && kept < left; ++j) {
    if (kept != j) std::copy_n(w.column(j), w.rows, w.column(kept));
    const double norm = orthogonalise_column(kept, full.col(j).data());
    if (norm > kDependent * scale) {
      full(kept++, j) = norm;
    } else if (fill_at_random(kept)) {
      ++kept;
    }
  }
  inner_.multiply();
  return full.topRows(kept);
}

}  // namespace carillon::eigen
