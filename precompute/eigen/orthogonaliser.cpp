// Method: The three-term recurrence is followed by one projection, against the whole basis only where orthogonality is about to be lost
// (orthogonality.cpp). The block is orthonormalised by Cholesky QR, twice if badly conditioned; column by column, with random columns in
// place of dependent ones, if singular.
// Source: Grimes, Lewis, Simon, A shifted block Lanczos algorithm, SIAM J. Matrix Anal. Appl. 15(1), 1994; Yamamoto et al., Roundoff error
// analysis of the CholeskyQR2 algorithm, ETNA 44, 2015.
#include "precompute/eigen/orthogonaliser.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "precompute/comm/communicator.hpp"
#include "precompute/petsc/noise.hpp"

namespace carillon::eigen {
namespace {

constexpr double kWellConditioned = 1e-2;  // Above this smallest pivot of the scaled Gram matrix, no second Cholesky QR.
constexpr double kDependent = 1e-11;       // Below this smallest pivot, Cholesky QR is not used.
constexpr double kReproject = 1e-2;        // A projection that removes more of a column's squared norm is repeated,
constexpr int kPasses = 3;                 // up to this many passes.
constexpr double kNegligible = 1e-9;       // Below this removed part, the semi-orthogonality of the basis is invisible in the rest.

// Rank 0 decides for all.
template <std::size_t count>
void take_from_first(const comm::Communicator& comm, std::array<int, count>& values) {
  comm.broadcast_into(std::span<int>(values));
}

// Scales a positive definite matrix to unit diagonal. False if it is not positive definite.
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

// R and its inverse from the Gram matrix of a block that still loses c along an almost orthonormal set. Empty if c is not small, or if the
// block is so badly conditioned that another step is needed.
void calc_triangle(const la::Matrix& c, la::Matrix gram, la::Matrix& r, la::Matrix& inverse) {
  r.resize(0, 0);
  const la::Vector square = gram.diagonal();
  if (!(c.colwise().squaredNorm().transpose().array() < kNegligible * square.array()).all()) return;
  gram -= c.transpose() * c;
  la::Vector scale;
  if (!scale_to_unit_diagonal(gram, scale) || la::factorise_cholesky(gram) != 0) return;
  if (!(gram.diagonal().array().square() > kWellConditioned).all()) return;
  inverse = gram.triangularView<Eigen::Upper>();
  inverse = inverse * scale.asDiagonal();
  const la::Matrix triangle = inverse;
  if (la::invert_upper(inverse) == 0) r = triangle;
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
  const la::Matrix r = project(nullptr);
  return static_cast<int>((r.size() > 0 ? r : orthonormalise()).rows());
}

void Orthogonaliser::step() {
  la::Matrix alpha;
  la::Matrix r = project(&alpha);
  basis_.set_diagonal(alpha);
  if (r.size() == 0) r = orthonormalise();
  if (r.rows() == basis_.width() && !confirm(r)) r = reproject(r);
  estimate_.advance(here(), r, is_skipped_);
  deflation_.advance(here(), r, projected_);
  for (int j = static_cast<int>(r.rows()); j < basis_.block(); ++j) {
    std::fill_n(inner_.w().column(j), inner_.w().rows, 0.0);
    std::fill_n(inner_.z().column(j), inner_.z().rows, 0.0);
  }
  basis_.set_coupling(std::move(r));
}

// Coefficients of V_{j-1} and V_j in A^-1 M V_j: R_{j-1}^T and alpha, (size - previous, width).
la::Matrix Orthogonaliser::calc_recurrence(const la::Matrix& alpha) const {
  const int width = basis_.width(), previous = basis_.previous(), coupled = basis_.size() - previous;
  la::Matrix local(coupled, width);
  local.topRows(coupled - width) = basis_.t().block(previous, basis_.size() - width, coupled - width, width);
  local.bottomRows(width) = alpha;
  return local;
}

// Decides which projections this step needs.
void Orthogonaliser::decide(const la::Matrix& alpha) {
  is_skipped_ = estimate_.can_skip_reorthogonalisation(here(), alpha);
  projected_ = deflation_.find_columns_to_project(here(), alpha);
  std::array<int, 3> decision{is_skipped_ ? 1 : 0, projected_.first, projected_.count};
  take_from_first(inner_.comm(), decision);
  is_skipped_ = decision[0] != 0;
  projected_ = {decision[1], decision[2]};
}

la::Matrix Orthogonaliser::subtract_and_vote(const la::Product& product, int s_stride, std::span<const Columns> against, int count) {
  CheckpointRequest own;
  if (checkpoint_ != nullptr) own = checkpoint_->ask();
  std::array<double, 2> votes{own.stop ? 1.0 : 0.0, own.save ? 1.0 : 0.0};
  la::Matrix products = inner_.subtract_and_calc_products(product, s_stride, against, count, votes);
  request_.stop = request_.stop || votes[0] > 0;
  request_.save = request_.save || votes[1] > 0;
  return products;
}

// A skipped step projects only against the blocks of the recurrence.
std::vector<Columns> Orthogonaliser::find_projected_out() const {
  std::vector<Columns> sets;
  if (is_skipped_) {
    sets = {basis_.columns(basis_.previous(), basis_.size() - basis_.previous())};
  } else {
    sets = {basis_.all()};
  }
  for (const Columns& part : locked_.find_parts(projected_)) sets.push_back(part);
  return sets;
}

// w -= V_{j-1} R_{j-1}^T + V_j alpha, with Z = M V_j, then w -= Q Q^T M w for all vectors Q so far. alpha: (width, width) diagonal block;
// null for the first block. The last pass also makes w M-orthonormal if the Gram matrix computed with its products allows it, by (w - V
// c)^T M (w - V c) = w^T M w - c^T c; then returns R, otherwise an empty matrix.
la::Matrix Orthogonaliser::project(la::Matrix* alpha) {
  const bool is_first = alpha == nullptr;
  const Columns next = inner_.w().part(0, count());
  la::Matrix local;  // coefficients of the recurrence
  la::Product recurrence{basis_.columns(0, 0), nullptr};
  is_skipped_ = false;
  projected_ = deflation_.all();
  if (!is_first) {
    *alpha = inner_.calc_products(inner_.z().part(0, basis_.width()), next);
    local = calc_recurrence(*alpha);
    recurrence = {basis_.columns(basis_.previous(), static_cast<int>(local.rows())), local.data()};
    decide(*alpha);
  }
  const std::vector<Columns> against = find_projected_out();
  std::vector<Columns> sets = against;
  sets.push_back(next);
  const int width = basis_.width(), basis = against.front().count;
  for (int pass = 0;; ++pass) {
    const la::Matrix c = subtract_and_vote(recurrence, static_cast<int>(local.rows()), sets, next.count);
    const auto stride = static_cast<int>(c.rows()), all = stride - next.count;
    const la::Matrix parts = c.middleRows(all - projected_.count, projected_.count);
    recurrence.a.count = 0;
    if (!is_first) (*alpha) += c.middleRows(basis - width, width);
    if (pass == 0 && !is_first) deflation_.update_noise(projected_, parts);
    if (pass == 0 && !is_first && !is_skipped_) estimate_.update_noise(here(), c.data(), stride);
    const la::Vector along_basis = c.topRows(basis).colwise().squaredNorm();
    // Largest removed part of a column's squared norm; its rounding error stays in the column.
    const double taken = (along_basis.array() / c.bottomRows(next.count).diagonal().array()).maxCoeff();
    if (!is_skipped_) estimate_.record_projection(std::sqrt(along_basis.maxCoeff()));
    estimate_.record_deflation(deflation_.calc_returned(projected_, parts));
    const bool is_last = !(taken >= kReproject) || pass + 1 == kPasses;
    la::Matrix r, inverse;
    if (is_last) calc_triangle(c.topRows(all), c.bottomRows(next.count), r, inverse);
    if (basis_.size() + next.count > free_dimension()) r.resize(0, 0);
    std::vector<la::Product> products;
    const double* coefficients = c.data();
    for (const Columns& set : against) {
      products.push_back({set, coefficients});
      coefficients += set.count;
    }
    inner_.subtract_and_combine(products, stride, r.size() > 0 ? inverse.data() : nullptr, next.count);
    if (is_last) return r;
  }
}

bool Orthogonaliser::confirm(const la::Matrix& r) const {
  std::array<int, 1> is_good{estimate_.is_confirmed(here(), r, is_skipped_) && deflation_.is_confirmed(here(), r) ? 1 : 0};
  take_from_first(inner_.comm(), is_good);
  return is_good[0] != 0;
}

// Performs the skipped projection, or two more passes, on the block obtained with R = before. The removed part is rounding of the operator.
// Returns the combined R.
la::Matrix Orthogonaliser::reproject(const la::Matrix& before) {
  is_skipped_ = false;
  estimate_.record_projection(0);
  estimate_.record_deflation(0);
  projected_ = deflation_.all();
  const Columns next = inner_.w().part(0, basis_.width());
  const Columns next_mass = inner_.z().part(0, basis_.width());
  const Columns all = basis_.all();
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

// Makes the columns of w M-orthonormal: w <- w R^-1, z <- M w. Returns R with one row per remaining column, fewer than columns if the space
// is exhausted.
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

// Orthogonalises column i of w twice against the basis, the locked modes and the preceding columns; adds to coefficients (i). Returns its
// M-norm, zero if almost nothing is left.
double Orthogonaliser::orthogonalise_column(int i, double* coefficients) {
  const Columns all = basis_.all();
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

// Fills column i with a random vector orthogonal to all others. False if none is found.
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
  double scale = 0;  // norm of the operator on the block; smaller values are rounding
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
