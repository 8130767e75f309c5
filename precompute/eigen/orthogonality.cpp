// Method: With A V = V T + w E^T, W_j = V^T M V_j obeys W_{j+1} R_j = T W_j - W_j alpha_j - W_{j-1} R_{j-1}^T + rounding. Rows of the last
// two blocks are left out, as these blocks are always projected out. The rounding of the operator is measured whenever the whole orthogonal
// basis is projected out. For locked eigenvectors, theta replaces T; subtracting c = L^T M w leaves V^T M L c along V, which is bounded by
// the remaining part of L and projected out where too large. Differences to the sources: whole matrices instead of norm bounds go through
// the recurrence, which is sharper at negligible cost; rounding is measured, not assumed; a projection is skipped only where far more than
// half of the digits stay.
// Source: Simon, The Lanczos algorithm with partial reorthogonalization, Math. Comp. 42, 1984; Grimes, Lewis, Simon, A shifted block
// Lanczos algorithm, SIAM J. Matrix Anal. Appl. 15(1), 1994, section 3.3.
#include "precompute/eigen/orthogonality.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <utility>

#include "precompute/petsc/noise.hpp"

namespace carillon::eigen {
namespace {

using la::gemm;
using la::Transpose;

constexpr double kOmegaMax = 2e-8;            // largest entry of W_j (Simon's omega) without a projection
constexpr double kOmegaAfterPass = 1e-10;     // the same after a projection
constexpr double kOmegaConfirmed = 2e-7;      // the same where R turns out smaller than predicted
constexpr double kDeflationMax = 1e-7;        // largest entry of L^T M V_j during the iteration; its effect on T is quadratic
constexpr double kDeflationConfirmed = 1e-6;  // the same where R turns out smaller than predicted
constexpr int kCleanBlocks = 3;               // blocks with all locked modes projected out before any projection is skipped
constexpr double kRounding = 10 * std::numeric_limits<double>::epsilon();  // an entry of W_j after a projection

double calc_largest(const la::Matrix& a) {
  double largest = 0;
  for (const double x : a.reshaped()) largest = std::max(largest, std::abs(x));
  return largest;
}

// Smallest factor 1 / max |R^-1|; R shrinks no column by more. 0 if R is not square or singular.
double calc_divisor(const la::Matrix& r, int width) {
  if (r.rows() != width) return 0;
  la::Matrix inverse = r;
  const int info = la::invert_upper(inverse);
  const double largest = calc_largest(inverse);
  return info == 0 && std::isfinite(largest) ? 1 / largest : 0;
}

// Uniform in [-1, 1), the same on all ranks.
double make_random(int i, int j) { return 2 * petsc::make_noise(static_cast<std::uint64_t>(i), static_cast<std::uint64_t>(j)); }

// Block of T that couples V_{j-1}, from row `previous` on, to V_j: R_{j-1}^T.
const double* find_coupling(const LanczosStep& step) { return &step.t(step.previous, step.size - step.width); }

}  // namespace

void OrthogonalityEstimate::reset() {
  last_.resize(0, 0);
  before_.resize(0, 0);
}

bool OrthogonalityEstimate::can_skip_reorthogonalisation(const LanczosStep& step, const la::Matrix& alpha) {
  const int m = step.size, b = step.width, old = step.size - step.previous - step.width;
  predicted_ = la::Matrix::Zero(m, b);
  if (last_.size() != predicted_.size() || before_.size() == 0) return false;
  gemm(Transpose::kNo, m, b, m, 1, step.t.data(), step.t.rows(), last_.data(), m, 0, predicted_.data(), m);
  gemm(Transpose::kNo, m, b, b, -1, last_.data(), m, alpha.data(), b, 1, predicted_.data(), m);
  gemm(Transpose::kNo, m, b, old, -1, before_.data(), m, find_coupling(step), step.t.rows(), 1, predicted_.data(), m);
  largest_ = noise_;
  for (int j = 0; j < b; ++j) {
    for (int i = 0; i < step.previous; ++i) largest_ = std::max(largest_, std::abs(predicted_(i, j)));
  }
  return noise_ > 0 && largest_ < kOmegaMax * divisor_;
}

void OrthogonalityEstimate::record_projection(double norm) { left_ = (worst_ + kRounding) * norm; }

bool OrthogonalityEstimate::is_confirmed(const LanczosStep& step, const la::Matrix& r, bool is_skipped) const {
  const double divisor = calc_divisor(r, step.width);
  return is_skipped ? largest_ + returned_ < kOmegaConfirmed * divisor : left_ + returned_ <= kOmegaAfterPass * divisor;
}

void OrthogonalityEstimate::update_noise(const LanczosStep& step, const double* c, int stride) {
  constexpr double kDecay = 0.7;
  if (since_skipped_ < 2) return;  // The prediction is partly noise itself then.
  double largest = 0;
  for (int j = 0; j < step.width; ++j) {
    for (int i = 0; i < step.previous; ++i)
      largest = std::max(largest, std::abs(c[static_cast<std::ptrdiff_t>(j) * stride + i] - predicted_(i, j)));
  }
  noise_ = std::max(kDecay * noise_, largest);
}

void OrthogonalityEstimate::advance(const LanczosStep& step, const la::Matrix& r, bool is_skipped) {
  const int m = step.size, b = step.width, next = static_cast<int>(r.rows()), all = m + next;
  const int known = step.previous;  // rows beyond are projected out in every step
  since_skipped_ = is_skipped ? 0 : since_skipped_ + 1;
  divisor_ = calc_divisor(r, b);
  const double cleared = std::max(kRounding, divisor_ > 0 ? ((is_skipped ? 0 : left_) + returned_) / divisor_ : 0);
  la::Matrix product = la::Matrix::Zero(all, next);
  for (int j = 0; j < next; ++j) {
    for (int i = 0; i < m; ++i) {
      const double random = make_random(i, j);
      product(i, j) = is_skipped && i < known && next == b ? predicted_(i, j) + (noise_ + returned_) * random : cleared * random;
    }
    product(m + j, j) = 1;
  }
  if (is_skipped && next == b) la::solve_upper_from_right(known, b, r.data(), b, product.data(), all);
  for (int j = 0; j < next; ++j) {
    for (int i = 0; i < m; ++i) worst_ = std::max(worst_, std::abs(product(i, j)));
  }
  left_ = returned_ = 0;
  before_.resize(0, 0);
  if (last_.size() == std::ptrdiff_t{m} * b) {
    before_.resize(all, b);
    before_.topRows(m) = last_;
    if (next > 0) before_.bottomRows(next) = product.middleRows(m - b, b).transpose();  // no next block: no row to copy
  }
  last_ = std::move(product);
}

DeflationEstimate::DeflationEstimate(std::vector<double> theta)
    : theta_(std::move(theta)), noise_(theta_.size(), 0.0), remaining_(theta_.size(), 0.0) {}

void DeflationEstimate::reset() {
  last_.resize(0, 0);
  before_.resize(0, 0);
  clean_ = 0;
}

LockedRange DeflationEstimate::find_columns_to_project(const LanczosStep& step, const la::Matrix& alpha) {
  const int rows = all().count, b = step.width, old = step.size - step.previous - step.width;
  predicted_ = la::Matrix::Zero(rows, b);
  largest_ = 0;
  scale_ = calc_largest(alpha);
  if (rows == 0 || clean_ == 0 || last_.size() != predicted_.size() || before_.size() != std::ptrdiff_t{rows} * old) return all();
  for (int j = 0; j < b; ++j) {
    for (int i = 0; i < rows; ++i) predicted_(i, j) = theta_[i] * last_(i, j);
  }
  gemm(Transpose::kNo, rows, b, b, -1, last_.data(), rows, alpha.data(), b, 1, predicted_.data(), rows);
  gemm(Transpose::kNo, rows, b, old, -1, before_.data(), rows, find_coupling(step), step.t.rows(), 1, predicted_.data(), rows);
  if (clean_ < kCleanBlocks) return all();
  std::vector<double> loss = noise_;
  for (int j = 0; j < b; ++j) {
    for (int i = 0; i < rows; ++i) {
      double& x = loss[i];
      x = std::max(x, std::abs(predicted_(i, j)));
    }
  }
  const auto is_lossy = [&](double x) { return !(x < kDeflationMax * divisor_); };
  const auto first = std::find_if(loss.begin(), loss.end(), is_lossy);
  const auto last = std::find_if(loss.rbegin(), std::make_reverse_iterator(first), is_lossy).base();
  for (auto x = loss.begin(); x != loss.end(); ++x) {
    if (x < first || x >= last) largest_ = std::max(largest_, *x);
  }
  return {static_cast<int>(first - loss.begin()), static_cast<int>(last - first)};
}

void DeflationEstimate::update_noise(LockedRange range, const la::Matrix& c) {
  constexpr double kMaxRise = 100;  // largest increase of the expected noise by one measurement
  for (int i = 0; i < range.count; ++i) {
    const int row = range.first + i;
    double& noise = noise_[row];
    double& remaining = remaining_[row];
    double measured = 0, predicted = 0;
    for (int j = 0; j < c.cols(); ++j) {
      measured = std::max(measured, std::abs(c(i, j)));
      predicted = std::max(predicted, std::abs(predicted_(row, j)));
    }
    if (clean_ > 0 && clean_ < kCleanBlocks) {
      noise = std::max(noise, measured);
    } else if (measured > predicted) {
      noise *= measured < kMaxRise * predicted ? measured / predicted : kMaxRise;
      // The residual of an inexact eigenvector lies along a few directions; its row jumps when the basis reaches them.
      remaining = std::max(remaining, (measured - predicted) / std::max(std::abs(theta_[row]), scale_));
    }
  }
}

double DeflationEstimate::calc_returned(LockedRange range, const la::Matrix& c) const {
  double largest = 0;
  for (int j = 0; j < c.cols(); ++j) {
    double sum = 0;
    for (int i = 0; i < range.count; ++i) sum += remaining_[range.first + i] * std::abs(c(i, j));
    largest = std::max(largest, sum);
  }
  return largest;
}

bool DeflationEstimate::is_confirmed(const LanczosStep& step, const la::Matrix& r) const {
  return largest_ == 0 || largest_ < kDeflationConfirmed * calc_divisor(r, step.width);
}

void DeflationEstimate::advance(const LanczosStep& step, const la::Matrix& r, LockedRange range) {
  const int rows = all().count, next = static_cast<int>(r.rows());
  if (rows == 0) return;
  divisor_ = calc_divisor(r, step.width);
  const bool is_cleared = range.count == rows || next != step.width;
  before_ = std::move(last_);
  last_ = la::Matrix::Zero(rows, next);
  if (!is_cleared) {
    for (int j = 0; j < next; ++j) {
      for (int i = 0; i < rows; ++i) last_(i, j) = predicted_(i, j) + noise_[i] * make_random(i, j);
    }
    la::solve_upper_from_right(rows, step.width, r.data(), step.width, last_.data(), rows);
  }
  const int from = is_cleared ? 0 : range.first;
  const int to = is_cleared ? rows : from + range.count;
  for (int j = 0; j < next; ++j) {
    for (int i = from; i < to; ++i) last_(i, j) = kRounding * make_random(i, j);
    for (int i = 0; i < rows; ++i) {
      double& remaining = remaining_[i];
      remaining = std::max(remaining, std::abs(last_(i, j)));
    }
  }
  clean_ = is_cleared || clean_ >= kCleanBlocks ? std::min(clean_ + 1, kCleanBlocks) : 0;
}

}  // namespace carillon::eigen
