// Method:     With A V = V T + w E^T, S_j = V^T M V_j obeys S_{j+1} R_j = T S_j - S_j alpha_j - S_{j-1} R_{j-1}^T + rounding, where the
//             rows of the last two blocks are left out, as these are always projected out. The rounding is the operator's: it is measured
//             whenever the basis is projected out with all of it orthogonal. Locked eigenvectors have their theta in the place of T;
//             c = L^T M w taken out of w leaves V^T M L c along V, which is bounded by what remained of L, and projected out
//             where that is too much.
// Source:     Simon, The Lanczos algorithm with partial reorthogonalization, Math. Comp. 42, 1984; Grimes, Lewis, Simon, A shifted block
//             Lanczos algorithm, SIAM J. Matrix Anal. Appl. 15(1), 1994, section 3.3.
// Deviations: whole matrices go through the recurrence where they bound norms, which is sharper and costs next to nothing; rounding is
//             measured, not assumed; only steps are spared that leave far more than half the digits.
#include "precompute/eigen/orthogonality.hpp"

#include <petscblaslapack.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>

#include "precompute/petsc/noise.hpp"

extern "C" void dtrtri_(const char* half, const char* diagonal, const int* n, double* a, const int* lda, int* info);

namespace carillon::eigen {
namespace {

constexpr double kGoodEnough = 2e-8;     // largest entry of V^T M V_j that remains
constexpr double kLeftStanding = 1e-10;  // the same, after a projection
constexpr double kTolerable = 2e-7;      // the same, where R turns out smaller than predicted
constexpr double kGoodForNow = 1e-7;     // largest entry of L^T M V_j that remains until the end: what it does to T is its square
constexpr double kTolerableForNow = 1e-6;
constexpr int kCleanBlocks = 3;                                            // wholly cleared of what is locked, before any is spared
constexpr double kRounding = 10 * std::numeric_limits<double>::epsilon();  // the same after a projection

// By how much R shrinks a column at most: the reciprocal of the largest entry of R^-1. 0 if R is not square or singular.
double calc_divisor(const std::vector<double>& r, int next_width, int width) {
  if (next_width != width) return 0;
  std::vector<double> inverse = r;
  PetscBLASInt size = next_width, info = 0;
  dtrtri_("U", "N", &size, inverse.data(), &size, &info);
  double largest = 0;
  for (const double x : inverse) largest = std::max(largest, std::abs(x));
  return info == 0 && std::isfinite(largest) ? 1 / largest : 0;
}

}  // namespace

void Orthogonality::forget() {
  last_.clear();
  before_.clear();
}

bool Orthogonality::is_good(const State& state, const double* alpha) {
  const auto size = static_cast<std::size_t>(state.size);
  const auto width = static_cast<std::size_t>(state.width);
  predicted_.assign(size * width, 0.0);
  if (last_.size() != size * width || before_.empty()) return false;
  PetscBLASInt m = state.size, b = state.width, old = state.size - state.previous - state.width, stride = state.stride;
  double one = 1, minus = -1, zero = 0;
  const double* r = state.t + static_cast<std::ptrdiff_t>(state.size - state.width) * state.stride + state.previous;
  BLASgemm_("N", "N", &m, &b, &m, &one, state.t, &stride, last_.data(), &m, &zero, predicted_.data(), &m);
  BLASgemm_("N", "N", &m, &b, &b, &minus, last_.data(), &m, alpha, &b, &one, predicted_.data(), &m);
  BLASgemm_("N", "N", &m, &b, &old, &minus, before_.data(), &m, r, &stride, &one, predicted_.data(), &m);
  largest_ = noise_;
  for (std::size_t j = 0; j < width; ++j) {
    for (int i = 0; i < state.previous; ++i) largest_ = std::max(largest_, std::abs(predicted_[j * size + static_cast<std::size_t>(i)]));
  }
  return noise_ > 0 && largest_ < kGoodEnough * divisor_;
}

void Orthogonality::clear(double norm) { left_ = (worst_ + kRounding) * norm; }

bool Orthogonality::is_still_good(const State& state, const std::vector<double>& r, int next_width, bool is_spared) const {
  const double divisor = calc_divisor(r, next_width, state.width);
  return is_spared ? largest_ + returned_ < kTolerable * divisor : left_ + returned_ <= kLeftStanding * divisor;
}

void Orthogonality::learn(const State& state, const double* c, int stride) {
  if (since_spared_ < 2) return;  // What is predicted then is partly noise itself.
  double largest = 0;
  for (int j = 0; j < state.width; ++j) {
    for (int i = 0; i < state.previous; ++i) {
      const double told = predicted_[static_cast<std::size_t>(j) * static_cast<std::size_t>(state.size) + static_cast<std::size_t>(i)];
      largest = std::max(largest, std::abs(c[static_cast<std::ptrdiff_t>(j) * stride + i] - told));
    }
  }
  noise_ = std::max(0.7 * noise_, largest);
}

void Orthogonality::advance(const State& state, const std::vector<double>& r, int next_width, bool is_spared) {
  const auto m = static_cast<std::size_t>(state.size);
  const auto b = static_cast<std::size_t>(state.width);
  const auto next = static_cast<std::size_t>(next_width);
  const auto known = static_cast<std::size_t>(state.previous);  // rows beyond are projected out in every step
  const std::size_t all = m + next;
  since_spared_ = is_spared ? 0 : since_spared_ + 1;
  divisor_ = calc_divisor(r, next_width, state.width);
  const double cleared = std::max(kRounding, divisor_ > 0 ? ((is_spared ? 0 : left_) + returned_) / divisor_ : 0);
  std::vector<double> product(all * next);
  for (std::size_t j = 0; j < next; ++j) {
    for (std::size_t i = 0; i < m; ++i) {
      const double random = 2 * petsc::make_noise(i, j);
      product[j * all + i] = is_spared && i < known && next == b ? predicted_[j * m + i] + (noise_ + returned_) * random : cleared * random;
    }
    product[j * all + m + j] = 1;
  }
  if (is_spared && next == b) {
    PetscBLASInt rows = state.previous, width = state.width, stride = static_cast<PetscBLASInt>(all);
    double one = 1;
    BLAStrsm_("R", "U", "N", "N", &rows, &width, &one, r.data(), &width, product.data(), &stride);
  }
  for (std::size_t j = 0; j < next; ++j) {
    for (std::size_t i = 0; i < m; ++i) worst_ = std::max(worst_, std::abs(product[j * all + i]));
  }
  left_ = returned_ = 0;
  before_.clear();
  if (last_.size() == m * b) {
    before_.resize(all * b);
    for (std::size_t j = 0; j < b; ++j) {
      std::copy_n(last_.data() + j * m, m, before_.data() + j * all);
      for (std::size_t i = 0; i < next; ++i) before_[j * all + m + i] = product[i * all + (m - b) + j];
    }
  }
  last_ = std::move(product);
}

LockedOrthogonality::LockedOrthogonality(std::vector<double> theta)
    : theta_(std::move(theta)), noise_(theta_.size(), 0.0), left_(theta_.size(), 0.0) {}

void LockedOrthogonality::forget() {
  last_.clear();
  before_.clear();
  clean_ = 0;
}

LockedRange LockedOrthogonality::find_lossy(const Orthogonality::State& state, const double* alpha) {
  const std::size_t rows = theta_.size();
  const auto width = static_cast<std::size_t>(state.width);
  const auto old = static_cast<std::size_t>(state.size - state.previous - state.width);
  predicted_.assign(rows * width, 0.0);
  largest_ = scale_ = 0;
  for (std::size_t i = 0; i < width * width; ++i) scale_ = std::max(scale_, std::abs(alpha[i]));
  if (rows == 0 || clean_ == 0 || last_.size() != rows * width || before_.size() != rows * old) return get_all();
  PetscBLASInt m = static_cast<PetscBLASInt>(rows), b = state.width, k = static_cast<PetscBLASInt>(old), stride = state.stride;
  double one = 1, minus = -1;
  const double* r = state.t + static_cast<std::ptrdiff_t>(state.size - state.width) * state.stride + state.previous;
  for (std::size_t j = 0; j < width; ++j) {
    for (std::size_t i = 0; i < rows; ++i) predicted_[j * rows + i] = theta_[i] * last_[j * rows + i];
  }
  BLASgemm_("N", "N", &m, &b, &b, &minus, last_.data(), &m, alpha, &b, &one, predicted_.data(), &m);
  BLASgemm_("N", "N", &m, &b, &k, &minus, before_.data(), &m, r, &stride, &one, predicted_.data(), &m);
  if (clean_ < kCleanBlocks) return get_all();
  std::vector<double> loss = noise_;
  for (std::size_t j = 0; j < width; ++j) {
    for (std::size_t i = 0; i < rows; ++i) loss[i] = std::max(loss[i], std::abs(predicted_[j * rows + i]));
  }
  const auto is_lossy = [&](double x) { return !(x < kGoodForNow * divisor_); };
  const auto first = std::find_if(loss.begin(), loss.end(), is_lossy);
  const auto last = std::find_if(loss.rbegin(), std::make_reverse_iterator(first), is_lossy).base();
  for (auto x = loss.begin(); x != loss.end(); ++x) {
    if (x < first || x >= last) largest_ = std::max(largest_, *x);
  }
  return {static_cast<int>(first - loss.begin()), static_cast<int>(last - first)};
}

void LockedOrthogonality::learn(LockedRange range, const double* c, int width) {
  constexpr double kMost = 100;  // by which one measurement raises what is expected
  const std::size_t rows = theta_.size();
  for (int i = 0; i < range.count; ++i) {
    const auto row = static_cast<std::size_t>(range.first + i);
    double measured = 0, told = 0;
    for (int j = 0; j < width; ++j) {
      measured = std::max(measured, std::abs(c[static_cast<std::ptrdiff_t>(j) * range.count + i]));
      told = std::max(told, std::abs(predicted_[static_cast<std::size_t>(j) * rows + row]));
    }
    if (clean_ > 0 && clean_ < kCleanBlocks) {
      noise_[row] = std::max(noise_[row], measured);
    } else if (measured > told) {
      noise_[row] *= measured < kMost * told ? measured / told : kMost;
      // An eigenvector that is not exact has a residual along a few directions, and the row jumps when the basis reaches them.
      left_[row] = std::max(left_[row], (measured - told) / std::max(std::abs(theta_[row]), scale_));
    }
  }
}

double LockedOrthogonality::calc_returned(LockedRange range, const std::vector<double>& c, int width) const {
  double largest = 0;
  for (int j = 0; j < width; ++j) {
    double sum = 0;
    for (int i = 0; i < range.count; ++i)
      sum += left_[static_cast<std::size_t>(range.first + i)] * std::abs(c[static_cast<std::size_t>(j * range.count + i)]);
    largest = std::max(largest, sum);
  }
  return largest;
}

bool LockedOrthogonality::is_still_good(const Orthogonality::State& state, const std::vector<double>& r, int next_width) const {
  return largest_ == 0 || largest_ < kTolerableForNow * calc_divisor(r, next_width, state.width);
}

void LockedOrthogonality::advance(const Orthogonality::State& state, const std::vector<double>& r, int next_width, LockedRange range) {
  const std::size_t rows = theta_.size();
  const auto next = static_cast<std::size_t>(next_width);
  if (rows == 0) return;
  divisor_ = calc_divisor(r, next_width, state.width);
  const bool is_cleared = range.count == get_all().count || next_width != state.width;
  before_ = std::move(last_);
  last_.assign(rows * next, 0.0);
  if (!is_cleared) {
    for (std::size_t j = 0; j < next; ++j) {
      for (std::size_t i = 0; i < rows; ++i) last_[j * rows + i] = predicted_[j * rows + i] + noise_[i] * 2 * petsc::make_noise(i, j);
    }
    PetscBLASInt m = static_cast<PetscBLASInt>(rows), width = state.width;
    double one = 1;
    BLAStrsm_("R", "U", "N", "N", &m, &width, &one, r.data(), &width, last_.data(), &m);
  }
  const auto from = is_cleared ? 0 : static_cast<std::size_t>(range.first);
  const auto to = is_cleared ? rows : from + static_cast<std::size_t>(range.count);
  for (std::size_t j = 0; j < next; ++j) {
    for (std::size_t i = from; i < to; ++i) last_[j * rows + i] = kRounding * 2 * petsc::make_noise(i, j);
    for (std::size_t i = 0; i < rows; ++i) left_[i] = std::max(left_[i], std::abs(last_[j * rows + i]));
  }
  clean_ = is_cleared || clean_ >= kCleanBlocks ? std::min(clean_ + 1, kCleanBlocks) : 0;
}

}  // namespace carillon::eigen
