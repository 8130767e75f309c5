// Method:     rows: eta = A . (q q^T), one product of a matrix whose columns are the pairs of modes with the vector of the pairs; the
//             gradient is the matrix sum of (l_r + eta_r) A_r times 2 q. Points: the gradients at the points, their strains, eta, and the
//             same way back. Diagonals are half in a triangle, since it is applied with its transpose.
// Source:     docs/equations.md E12.
// Deviations: none.
#include "runtime/nonlinear/evaluator.hpp"

#include <algorithm>
#include <cmath>

namespace carillon::nonlinear {
namespace {

constexpr int pad(int count, int unit) noexcept { return (count + unit - 1) / unit * unit; }

double find_largest(const std::vector<float>& values) {
  double largest = 0.0;
  for (const float value : values) largest = std::max(largest, std::abs(static_cast<double>(value)));
  return largest;
}

bool is_diagonal(const bank::QuarticEnergy& energy) {
  const std::size_t n = energy.mode_count();
  for (std::size_t r = 0; r < energy.row_count(); ++r)
    for (std::size_t j = 0; j < n; ++j)
      for (std::size_t i = 0; i < j; ++i)
        if (energy.rows[r * bank::count_pairs(n) + bank::find_pair(i, j)] != 0.0F) return false;
  return true;
}

}  // namespace

Evaluator::Evaluator(const bank::QuarticEnergy& energy, const CoupledKernels& kernels)
    : kernels_(&kernels),
      modes_(static_cast<int>(energy.mode_count())),
      padded_(pad(modes_, kUnit) + kUnit),
      rows_(static_cast<int>(energy.row_count())),
      is_curved_(!energy.linear.empty()) {
  if (energy.is_of_points())
    add_points(energy);
  else if (is_diagonal(energy))
    add_diagonals(energy);
  else
    add_rows(energy);
  const auto padded_rows = static_cast<std::size_t>(pad(rows_, kUnit));
  eta_.assign(padded_rows, 0.0F);
  of_linear_.assign(padded_rows, 0.0F);
  forces_.assign(static_cast<std::size_t>(padded_), 0.0F);
  more_.assign(static_cast<std::size_t>(padded_), 0.0F);
  if (is_curved_ && form_ != Form::kDiagonals) {
    linear_.assign(padded_rows * static_cast<std::size_t>(padded_), 0.0F);
    for (std::size_t r = 0; r < static_cast<std::size_t>(rows_); ++r)
      for (std::size_t i = 0; i < static_cast<std::size_t>(modes_); ++i)
        linear_[r * static_cast<std::size_t>(padded_) + i] =
            static_cast<float>(energy.linear[r * static_cast<std::size_t>(modes_) + i] / scale_);
  }
  set_count(modes_);
}

void Evaluator::add_diagonals(const bank::QuarticEnergy& energy) {
  form_ = Form::kDiagonals;
  const std::size_t n = energy.mode_count();
  for (std::size_t r = 0; r < energy.row_count(); ++r)
    for (std::size_t i = 0; i < n; ++i)
      diagonals_.push_back(static_cast<double>(energy.rows[r * bank::count_pairs(n) + bank::find_pair(i, i)]));
  exact_linear_ = energy.linear;
}

void Evaluator::add_rows(const bank::QuarticEnergy& energy) {
  form_ = Form::kRows;
  const std::size_t n = energy.mode_count();
  const double largest = find_largest(energy.rows);
  scale_ = largest > 0.0 ? std::sqrt(largest) : 1.0;
  stride_ = pad(static_cast<int>(find_column(modes_)), kUnit);
  matrices_.assign(static_cast<std::size_t>(stride_ * pad(rows_, kRowsAtOnce)), 0.0F);
  for (std::size_t r = 0; r < energy.row_count(); ++r)
    for (std::size_t j = 0; j < n; ++j)
      for (std::size_t i = 0; i <= j; ++i) {
        const double entry = static_cast<double>(energy.rows[r * bank::count_pairs(n) + bank::find_pair(i, j)]);
        matrices_[r * static_cast<std::size_t>(stride_) + static_cast<std::size_t>(find_column(static_cast<int>(j))) + i] =
            static_cast<float>(entry / (scale_ * scale_) * (i == j ? 0.5 : 1.0));
      }
  pairs_.assign(static_cast<std::size_t>(stride_), 0.0F);
  sum_.assign(static_cast<std::size_t>(stride_), 0.0F);
}

void Evaluator::add_points(const bank::QuarticEnergy& energy) {
  form_ = Form::kPoints;
  const std::size_t n = energy.mode_count(), parts = energy.gradient_count(), strains = energy.strain_count(), all = energy.point_count();
  std::vector<std::size_t> used;
  for (std::size_t p = 0; p < all; ++p)
    if (energy.weight[p] > 0.0) used.push_back(p);
  parts_ = static_cast<int>(parts);
  strains_ = static_cast<int>(strains);
  points_ = pad(std::max(1, static_cast<int>(used.size())), kUnit);
  double steepest = find_largest(energy.gradient), largest = 0.0;
  if (!(steepest > 0.0)) steepest = 1.0;
  const auto weigh = [&](std::size_t r, std::size_t p, std::size_t s) {
    return energy.weight[p] * static_cast<double>(energy.stress[(r * all + p) * strains + s]);
  };
  for (std::size_t r = 0; r < energy.row_count(); ++r)
    for (const std::size_t p : used)
      for (std::size_t s = 0; s < strains; ++s) largest = std::max(largest, std::abs(weigh(r, p, s)));
  if (!(largest > 0.0)) largest = 1.0;
  scale_ = std::sqrt(largest) * steepest;
  const auto points = static_cast<std::size_t>(points_);
  stride_ = points_ * strains_;
  columns_.assign(n * parts * points, 0.0F);
  matrices_.assign(static_cast<std::size_t>(stride_ * pad(rows_, kRowsAtOnce)), 0.0F);
  for (std::size_t u = 0; u < used.size(); ++u) {
    for (std::size_t c = 0; c < parts; ++c)
      for (std::size_t j = 0; j < n; ++j)
        columns_[(j * parts + c) * points + u] =
            static_cast<float>(static_cast<double>(energy.gradient[(used[u] * parts + c) * n + j]) / steepest);
    for (std::size_t r = 0; r < energy.row_count(); ++r)
      for (std::size_t s = 0; s < strains; ++s)
        matrices_[r * static_cast<std::size_t>(stride_) + s * points + u] = static_cast<float>(weigh(r, used[u], s) / largest);
  }
  pairs_.assign(static_cast<std::size_t>(stride_), 0.0F);
  sum_.assign(static_cast<std::size_t>(stride_), 0.0F);
  gradient_.assign(parts * points, 0.0F);
  back_.assign(parts * points, 0.0F);
}

void Evaluator::set_count(int modes) noexcept {
  count_ = std::clamp(modes, 0, modes_);
  std::fill(pairs_.begin(), pairs_.end(), 0.0F);  // of pairs that are no more
}

double Evaluator::evaluate_diagonals(const double* im, const double* to_q, double* gradient) noexcept {
  const auto n = static_cast<std::size_t>(modes_), count = static_cast<std::size_t>(count_);
  std::fill(gradient, gradient + n, 0.0);
  double energy = 0.0;
  for (std::size_t r = 0; r < static_cast<std::size_t>(rows_); ++r) {
    const double* a = diagonals_.data() + r * n;
    const double* b = is_curved_ ? exact_linear_.data() + r * n : nullptr;
    double eta = 0.0, linear = 0.0;
    for (std::size_t i = 0; i < count; ++i) {
      const double q = to_q[i] * im[i];
      eta += a[i] * q * q;
      if (b != nullptr) linear += b[i] * q;
    }
    energy += eta * (linear + 0.5 * eta);
    for (std::size_t i = 0; i < count; ++i)
      gradient[i] += 2.0 * (linear + eta) * a[i] * to_q[i] * im[i] + (b != nullptr ? eta * b[i] : 0.0);
  }
  return energy;
}

double Evaluator::evaluate(const float* q, const double* im, const double* to_q, double* gradient) noexcept {
  if (form_ == Form::kDiagonals) return evaluate_diagonals(im, to_q, gradient);
  const std::ptrdiff_t length = static_cast<std::ptrdiff_t>(points_) * parts_;
  if (is_curved_) kernels_->gather(linear_.data(), padded_, q, rows_, of_linear_.data());
  double energy = 0.0, factor = scale_;
  const auto square = [&](int width, float weight) {
    return kernels_->square(matrices_.data(), stride_, width, pad(rows_, kRowsAtOnce), pairs_.data(), weight, of_linear_.data(),
                            eta_.data(), sum_.data());
  };
  if (form_ == Form::kRows) {
    kernels_->multiply(count_, q, pairs_.data());
    energy = square(pad(static_cast<int>(find_column(count_)), kUnit), 2.0F);
    kernels_->apply(count_, sum_.data(), q, forces_.data());
    factor *= 2.0;
  } else {
    kernels_->spread(columns_.data(), length, q, count_, gradient_.data());
    kernels_->strain(parts_, points_, gradient_.data(), pairs_.data());
    energy = square(static_cast<int>(stride_), 1.0F);
    kernels_->pull_back(parts_, points_, gradient_.data(), sum_.data(), back_.data());
    kernels_->gather(columns_.data(), length, back_.data(), count_, forces_.data());
  }
  for (int i = 0; i < count_; ++i) gradient[i] = factor * static_cast<double>(forces_[static_cast<std::size_t>(i)]);
  if (is_curved_) {
    kernels_->spread(linear_.data(), padded_, eta_.data(), rows_, more_.data());
    for (int i = 0; i < count_; ++i) gradient[i] += scale_ * static_cast<double>(more_[static_cast<std::size_t>(i)]);
  }
  std::fill(gradient + count_, gradient + modes_, 0.0);
  return energy;
}

std::size_t Evaluator::calc_bytes() const noexcept {
  std::size_t bytes = (diagonals_.capacity() + exact_linear_.capacity()) * sizeof(double);
  for (const auto* values : {&matrices_, &columns_, &linear_, &eta_, &of_linear_, &pairs_, &sum_, &gradient_, &back_, &forces_, &more_})
    bytes += values->capacity() * sizeof(float);
  return bytes;
}

}  // namespace carillon::nonlinear
