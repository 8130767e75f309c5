// Method:     rows: eta = A . (q q^T), a product of a matrix whose columns are the pairs of modes with the vector of pairs; the gradient is
//             the matrix sum of (l_r + eta_r) A_r times 2 q. Entries: the same for sparse rows; both products gather, by rows for eta and
//             by pairs for the sum, without scattering. Points: gradients at the points, their strains, eta, and the adjoint. Diagonals are
//             halved in a triangle, since it is applied with its transpose.
// Source:     docs/equations.md E12.
#include "runtime/synth/nonlinear/evaluator.hpp"

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

/// Fill ratio above which dense products are cheaper: see tests/bench/nonlinear.
constexpr double kMostEntries = 0.2;

bool is_sparse(const bank::QuarticEnergy& energy) {
  const auto entries = std::count_if(energy.rows.begin(), energy.rows.end(), [](float entry) { return entry != 0.0F; });
  return static_cast<double>(entries) <= kMostEntries * static_cast<double>(energy.rows.size());
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
  else if (is_sparse(energy))
    add_entries(energy);
  else
    add_rows(energy);
  const std::size_t padded_rows = pad(rows_, kUnit);
  eta_.assign(padded_rows, 0.0F);
  of_linear_.assign(padded_rows, 0.0F);
  forces_.assign(padded_, 0.0F);
  more_.assign(padded_, 0.0F);
  if (form_ == Form::kEntries) weight_.assign(padded_rows, 0.0F);
  if (is_curved_ && form_ != Form::kDiagonals) {
    linear_.assign(padded_rows * static_cast<std::size_t>(padded_), 0.0F);
    for (std::size_t r = 0; r < static_cast<std::size_t>(rows_); ++r)
      for (std::size_t i = 0; i < static_cast<std::size_t>(modes_); ++i)
        linear_[r * static_cast<std::size_t>(padded_) + i] =
            static_cast<float>(energy.linear[(places_.empty() ? r : places_[r]) * static_cast<std::size_t>(modes_) + i] / scale_);
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
  matrices_.assign(stride_ * pad(rows_, kRowsAtOnce), 0.0F);
  for (std::size_t r = 0; r < energy.row_count(); ++r)
    for (std::size_t j = 0; j < n; ++j)
      for (std::size_t i = 0; i <= j; ++i) {
        const double entry = static_cast<double>(energy.rows[r * bank::count_pairs(n) + bank::find_pair(i, j)]);
        matrices_[r * static_cast<std::size_t>(stride_) + static_cast<std::size_t>(find_column(static_cast<int>(j))) + i] =
            static_cast<float>(entry / (scale_ * scale_) * (i == j ? 0.5 : 1.0));
      }
  pairs_.assign(stride_, 0.0F);
  sum_.assign(stride_, 0.0F);
}

/// kUnit rows are padded with zeros to the longest of them.
void Evaluator::Entries::append(const std::vector<std::pair<std::int32_t, float>>* rows, int count) {
  std::size_t longest = 0;
  for (int r = 0; r < count; ++r) longest = std::max(longest, rows[r].size());
  if (begin.empty()) begin.push_back(0);
  begin.push_back(begin.back() + static_cast<std::int32_t>(longest));
  for (std::size_t e = 0; e < longest; ++e)
    for (int l = 0; l < kUnit; ++l) {
      const bool is_there = l < count && e < rows[l].size();
      index.push_back(is_there ? rows[l][e].first : 0);
      values.push_back(is_there ? rows[l][e].second : 0.0F);
    }
}

void Evaluator::add_entries(const bank::QuarticEnergy& energy) {
  form_ = Form::kEntries;
  const std::size_t n = energy.mode_count();
  const double largest = find_largest(energy.rows);
  scale_ = largest > 0.0 ? std::sqrt(largest) : 1.0;
  stride_ = pad(static_cast<int>(find_column(modes_)), kUnit);
  std::vector<std::vector<std::pair<std::int32_t, float>>> by_row(energy.row_count()), by_pair(static_cast<std::size_t>(stride_));
  for (std::size_t r = 0; r < energy.row_count(); ++r)
    for (std::size_t j = 0; j < n; ++j)
      for (std::size_t i = 0; i <= j; ++i) {
        const double entry = static_cast<double>(energy.rows[r * bank::count_pairs(n) + bank::find_pair(i, j)]);
        if (entry == 0.0) continue;
        const auto pair = static_cast<std::int32_t>(find_column(static_cast<int>(j)) + static_cast<std::ptrdiff_t>(i));
        by_row[r].emplace_back(pair, static_cast<float>(entry / (scale_ * scale_) * (i == j ? 0.5 : 1.0)));
      }
  // Sort rows by length.
  std::vector<std::size_t> order(by_row.size());
  for (std::size_t r = 0; r < order.size(); ++r) order[r] = r;
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return by_row[a].size() > by_row[b].size(); });
  std::vector<std::vector<std::pair<std::int32_t, float>>> sorted;
  for (const std::size_t r : order) {
    for (const auto& [pair, value] : by_row[r]) by_pair[pair].emplace_back(static_cast<std::int32_t>(sorted.size()), value);
    sorted.push_back(by_row[r]);
  }
  for (int first = 0; first < rows_; first += kUnit) of_rows_.append(sorted.data() + first, std::min(kUnit, rows_ - first));
  for (std::ptrdiff_t first = 0; first < stride_; first += kUnit) of_pairs_.append(by_pair.data() + first, kUnit);
  places_ = std::move(order);
  pairs_.assign(stride_, 0.0F);
  sum_.assign(stride_, 0.0F);
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
  const std::size_t points = points_;
  stride_ = points_ * strains_;
  columns_.assign(n * parts * points, 0.0F);
  matrices_.assign(stride_ * pad(rows_, kRowsAtOnce), 0.0F);
  for (std::size_t u = 0; u < used.size(); ++u) {
    for (std::size_t c = 0; c < parts; ++c)
      for (std::size_t j = 0; j < n; ++j)
        columns_[(j * parts + c) * points + u] =
            static_cast<float>(static_cast<double>(energy.gradient[(used[u] * parts + c) * n + j]) / steepest);
    for (std::size_t r = 0; r < energy.row_count(); ++r)
      for (std::size_t s = 0; s < strains; ++s)
        matrices_[r * static_cast<std::size_t>(stride_) + s * points + u] = static_cast<float>(weigh(r, used[u], s) / largest);
  }
  pairs_.assign(stride_, 0.0F);
  sum_.assign(stride_, 0.0F);
  gradient_.assign(parts * points, 0.0F);
  back_.assign(parts * points, 0.0F);
}

void Evaluator::set_count(int modes) noexcept {
  count_ = std::clamp(modes, 0, modes_);
  std::fill(pairs_.begin(), pairs_.end(), 0.0F);  // pairs no longer coupled
}

double Evaluator::evaluate_diagonals(const double* im, const double* to_q, double* gradient) noexcept {
  const std::size_t n = modes_, count = count_;
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
  if (form_ == Form::kEntries) {
    const int rows = pad(rows_, kUnit), groups = rows / kUnit;
    kernels_->multiply(count_, q, pairs_.data());
    kernels_->sum_up(of_rows_.begin.data(), groups, of_rows_.values.data(), of_rows_.index.data(), pairs_.data(), eta_.data());
    energy = kernels_->weigh(rows, 2.0F, of_linear_.data(), eta_.data(), weight_.data());
    kernels_->sum_up(of_pairs_.begin.data(), pad(static_cast<int>(find_column(count_)), kUnit) / kUnit, of_pairs_.values.data(),
                     of_pairs_.index.data(), weight_.data(), sum_.data());
    kernels_->apply(count_, sum_.data(), q, forces_.data());
    factor *= 2.0;
  } else if (form_ == Form::kRows) {
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
  for (int i = 0; i < count_; ++i) gradient[i] = factor * static_cast<double>(forces_[i]);
  if (is_curved_) {
    kernels_->spread(linear_.data(), padded_, eta_.data(), rows_, more_.data());
    for (int i = 0; i < count_; ++i) gradient[i] += scale_ * static_cast<double>(more_[i]);
  }
  std::fill(gradient + count_, gradient + modes_, 0.0);
  return energy;
}

std::size_t Evaluator::calc_bytes() const noexcept {
  std::size_t bytes = (diagonals_.capacity() + exact_linear_.capacity()) * sizeof(double);
  for (const auto* values : {&matrices_, &columns_, &linear_, &eta_, &weight_, &of_linear_, &pairs_, &sum_, &gradient_, &back_, &forces_,
                             &more_, &of_rows_.values, &of_pairs_.values})
    bytes += values->capacity() * sizeof(float);
  for (const auto* numbers : {&of_rows_.begin, &of_rows_.index, &of_pairs_.begin, &of_pairs_.index})
    bytes += numbers->capacity() * sizeof(std::int32_t);
  bytes += places_.capacity() * sizeof(std::size_t);
  return bytes;
}

}  // namespace carillon::nonlinear
