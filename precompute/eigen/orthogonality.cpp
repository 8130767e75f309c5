// Method:     With A V = V T + w E^T, S_j = V^T M V_j obeys S_{j+1} R_j = T S_j - S_j alpha_j - S_{j-1} R_{j-1}^T + rounding, where the
// rows of
//             the last two blocks are left out, as these are always projected out. The rounding is the operator's: it is measured whenever
//             the basis is projected out with all of it orthogonal.
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

#include "precompute/petsc/noise.hpp"

extern "C" void dtrtri_(const char* half, const char* diagonal, const int* n, double* a, const int* lda, int* info);

namespace carillon::eigen {
namespace {

constexpr double kGoodEnough = 2e-8;                                       // largest entry of V^T M V_j that is left standing
constexpr double kTolerable = 2e-7;                                        // the same, where R turns out smaller than foreseen
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
  foreseen_.assign(size * width, 0.0);
  if (last_.size() != size * width || before_.empty()) return false;
  PetscBLASInt m = state.size, b = state.width, old = state.size - state.previous - state.width, stride = state.stride;
  double one = 1, minus = -1, zero = 0;
  const double* r = state.t + static_cast<std::ptrdiff_t>(state.size - state.width) * state.stride + state.previous;
  BLASgemm_("N", "N", &m, &b, &m, &one, state.t, &stride, last_.data(), &m, &zero, foreseen_.data(), &m);
  BLASgemm_("N", "N", &m, &b, &b, &minus, last_.data(), &m, alpha, &b, &one, foreseen_.data(), &m);
  BLASgemm_("N", "N", &m, &b, &old, &minus, before_.data(), &m, r, &stride, &one, foreseen_.data(), &m);
  largest_ = noise_;
  for (std::size_t j = 0; j < width; ++j) {
    for (int i = 0; i < state.previous; ++i) largest_ = std::max(largest_, std::abs(foreseen_[j * size + static_cast<std::size_t>(i)]));
  }
  return noise_ > 0 && largest_ < kGoodEnough * divisor_;
}

bool Orthogonality::is_still_good(const State& state, const std::vector<double>& r, int next_width) const {
  return largest_ < kTolerable * calc_divisor(r, next_width, state.width);
}

void Orthogonality::learn(const State& state, const double* c, int stride) {
  if (since_spared_ < 2) return;  // What is foreseen then is partly noise itself.
  double largest = 0;
  for (int j = 0; j < state.width; ++j) {
    for (int i = 0; i < state.previous; ++i) {
      const double told = foreseen_[static_cast<std::size_t>(j) * static_cast<std::size_t>(state.size) + static_cast<std::size_t>(i)];
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
  std::vector<double> product(all * next);
  for (std::size_t j = 0; j < next; ++j) {
    for (std::size_t i = 0; i < m; ++i) {
      const double random = 2 * petsc::make_noise(i, j);
      product[j * all + i] = is_spared && i < known && next == b ? foreseen_[j * m + i] + noise_ * random : kRounding * random;
    }
    product[j * all + m + j] = 1;
  }
  if (is_spared && next == b) {
    PetscBLASInt rows = state.previous, width = state.width, stride = static_cast<PetscBLASInt>(all);
    double one = 1;
    BLAStrsm_("R", "U", "N", "N", &rows, &width, &one, r.data(), &width, product.data(), &stride);
  }
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

}  // namespace carillon::eigen
