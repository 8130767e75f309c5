#include "runtime/bank/packed/fit_shapes.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>

#include "runtime/bank/packed/fit_loops.hpp"
#include "runtime/bank/packed/loops.hpp"
#include "runtime/bank/packed/neighbours.hpp"
#include "runtime/bank/packed/stencil.hpp"
#include "runtime/base/large.hpp"

namespace carillon::packed {
namespace {

// From the finest level up; the last values apply to all coarser ones. Quantisation steps in steps of the modes, and fractions that round
// to 0.
constexpr std::array kResidualSteps{1.6F, 1.2F, 0.7F, 0.45F, 0.35F};
constexpr std::array kRounding{0.1F, 0.2F, 0.4F, 0.5F, 0.5F};
constexpr double kCoefficientStep = 0.5;  // prediction error by coefficient rounding over that of the residual
constexpr double kPrior = 0.02;
// Bits of a number q: constant at 0, a + 2 log2 |q| elsewhere; squared error [squared steps] traded for one bit.
constexpr float kZeroResidual = 0.25F, kOneResidual = 2.5F, kZeroCoefficient = 1.0F, kOneCoefficient = 1.8F, kPerError = 3.0F;
constexpr std::size_t kFeatureSamples = 400;  // vertices per level sampled for feature sizes
constexpr float kMaxSteps = 1e9F;             // limit of a number; the finest steps are 46,000 times smaller than those of the level

template <std::size_t N>
float find_of_level(const std::array<float, N>& values, std::size_t from_finest) {
  return values[std::min(from_finest, N - 1)];
}

// Fixed capacity instead of heap memory: a million instances per bank.
using Coefficients = Eigen::Matrix<double, Eigen::Dynamic, 3, 0, kFields, 3>;
using Rounded = Eigen::Matrix<int, Eigen::Dynamic, 3, 0, kFields, 3>;
using Square = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kFields, kFields>;

class Fitter {
 public:
  Fitter(const Surface& surface, std::size_t modes, std::span<const std::uint8_t> fineness, std::span<const float> factor,
         const GetRow& get_wanted)
      : surface_(surface),
        fineness_(fineness),
        factor_(factor),
        get_wanted_(get_wanted),
        modes_(modes),
        rows_(surface.level_begin[surface.level_count() - 1], modes),
        wanted_(rows_.get_width()),
        row_(rows_.get_width()),
        shape_row_(rows_.get_width()),
        columns_(rows_.get_padded()) {
    base::reserve_large(shape_, surface.places.size() * modes * 3);
  }

  FittedShapes run() {
    std::vector<LevelNumbers> levels;
    for (std::size_t level = 0; level < surface_.level_count(); ++level) levels.push_back(fit_level(level));
    return {std::move(levels), std::move(shape_)};
  }

 private:
  /// One candidate prediction of a vertex: coefficients and residual.
  struct Trial {
    Fit fit = Fit::kNone;
    Rounded numbers;    // (fields, 3)
    float cost = 0.0F;  // bits plus weighted error
  };

  void begin_vertex(std::size_t v) {
    share_ = LevelSteps::calc_share(fineness_[v]);
    cost_.step = share_ * level_step_;
    get_wanted_(v, wanted_);
  }

  LevelNumbers fit_level(std::size_t level) {
    const std::size_t first = surface_.level_begin[level], end = surface_.level_begin[level + 1];
    const std::size_t from_finest = surface_.level_count() - 1 - level;
    level_step_ = find_of_level(kResidualSteps, from_finest);
    cost_.rounding = find_of_level(kRounding, from_finest);
    is_finest_ = from_finest == 0;
    LevelNumbers numbers;
    numbers.steps.residual = level_step_;
    base::reserve_large(numbers.residual, (end - first) * 3 * modes_);
    if (level == 0) {
      for (std::size_t v = first; v < end; ++v) {
        std::fill(row_.begin(), row_.end(), 0.0F);
        begin_vertex(v);
        numbers.kinds.push_back({Fit::kNone, add_residual(numbers), fineness_[v]});
      }
      return numbers;
    }
    const std::span<const Place> known = std::span(surface_.places).first(first);
    const int shift = find_cell_shift(known);
    numbers.steps.cell_shift = static_cast<std::uint8_t>(shift);
    NeighbourSearch search(known, shift);
    std::vector<Neighbours> neighbours(end - first);
    std::vector<Stencil> stencils(end - first);
    for (std::size_t v = first; v < end; ++v) neighbours[v - first] = search.find(surface_.places[v]);
    calc_stencils(std::span(surface_.places).subspan(first, end - first), neighbours, surface_.places, stencils);
    set_coefficient_steps(neighbours, stencils, numbers.steps);
    for (std::size_t v = first; v < end; ++v) fit_vertex(v, neighbours[v - first], stencils[v - first], numbers);
    return numbers;
  }

  void calc_columns(const Neighbours& neighbours, const Stencil& stencil) {
    energy_ = 0.0F;
    for (std::size_t k = 0; k < kNeighbours; ++k) {
      from_[k] = rows_.get(neighbours[k]);
      energy_ += energies_[neighbours[k]] / static_cast<float>(kNeighbours);
    }
    fit_loops_.calc_columns(from_.data(), wanted_.data(), stencil, columns_);
  }

  /// Coefficient steps whose rounding changes the prediction by kCoefficientStep of the residual's step on average.
  void set_coefficient_steps(const std::vector<Neighbours>& neighbours, const std::vector<Stencil>& stencils, LevelSteps& steps) {
    double gradient = 0.0, differences = 0.0, count = 0.0;
    const std::size_t stride = std::max<std::size_t>(neighbours.size() / kFeatureSamples, 1), padded = columns_.get_padded();
    for (std::size_t i = 0; i < neighbours.size(); i += stride) {
      calc_columns(neighbours[i], stencils[i]);
      const auto calc_log = [&](std::size_t column, std::size_t fields) {
        const double mean = static_cast<double>(loops_.calc_energy(columns_.get(column), fields * padded)) / static_cast<double>(fields);
        return std::log((1.0 + static_cast<double>(energy_)) / std::max(mean, 1e-6));
      };
      gradient += calc_log(Columns::kGradient, kGradientFields);
      differences += calc_log(Columns::kDifferences, kFields - kGradientFields);
      count += 1.0;
    }
    const double error = kCoefficientStep * static_cast<double>(level_step_) * std::sqrt(static_cast<double>(modes_));
    steps.gradient = static_cast<float>(error / std::sqrt(kGradientFields) * std::exp(0.5 * gradient / count));
    steps.differences = static_cast<float>(error / std::sqrt(kFields) * std::exp(0.5 * differences / count));
  }

  /// Least squares for the first `count` fields from products_, regularised, and rounded.
  Trial try_fit(Fit fit, std::size_t count, const LevelSteps& steps) const {
    const auto fields = static_cast<Eigen::Index>(count);
    const double unit = static_cast<double>(share_) / std::sqrt(1.0 + static_cast<double>(energy_));
    const auto get_product = [&](std::size_t field, std::size_t column) {
      return static_cast<double>(products_[(Columns::kGradient + field) * Columns::kCount + column]);
    };
    std::array<double, kFields> step;
    Square regular(fields, fields);
    Coefficients target(fields, 3), coefficients(fields, 3);
    for (std::size_t j = 0; j < count; ++j) {
      const auto row = static_cast<Eigen::Index>(j);
      step[j] = unit * static_cast<double>(j < kGradientFields ? steps.gradient : steps.differences);
      for (std::size_t i = 0; i <= j; ++i) regular(row, static_cast<Eigen::Index>(i)) = get_product(j, Columns::kGradient + i);
      const double weight = static_cast<double>(cost_.step) / step[j];
      regular(row, row) += kPrior * weight * weight + 1e-12;
      for (std::size_t to = 0; to < 3; ++to) target(row, static_cast<Eigen::Index>(to)) = get_product(j, to);
    }
    const Eigen::LLT<Eigen::Ref<Square>, Eigen::Lower> factor(regular);  // in place
    regular.triangularView<Eigen::Lower>().solveInPlace(target);
    Trial trial{fit, Rounded(fields, 3), 0.0F};
    std::array<float, 3 * kFields> as_used;
    for (Eigen::Index to = 0; to < 3; ++to) {
      for (Eigen::Index j = fields; j-- > 0;) {
        const Eigen::Index rest = fields - 1 - j;
        const double x = (target(j, to) - regular.col(j).tail(rest).dot(coefficients.col(to).tail(rest))) / regular(j, j);
        const double rounded = std::clamp(std::nearbyint(x / step[j]), -static_cast<double>(kMaxSteps), static_cast<double>(kMaxSteps));
        trial.numbers(j, to) = static_cast<int>(rounded);
        coefficients(j, to) = rounded * step[j];
        as_used[3 * j + to] = static_cast<float>(coefficients(j, to));
        trial.cost += rounded == 0.0 ? kZeroCoefficient : kOneCoefficient + 2.0F * std::log2(static_cast<float>(std::abs(rounded)));
      }
    }
    trial.cost += fit_loops_.calc_cost(columns_, as_used.data(), count, cost_);
    return trial;
  }

  void fit_vertex(std::size_t v, const Neighbours& neighbours, const Stencil& stencil, LevelNumbers& numbers) {
    begin_vertex(v);
    calc_columns(neighbours, stencil);
    Trial best{Fit::kNone, {}, fit_loops_.calc_cost(columns_, nullptr, 0, cost_)};
    // Lower bound of a trial's cost: all coefficients and residuals are 0.
    const auto find_least = [&](std::size_t fields) {
      return 3.0F * (static_cast<float>(fields) * kZeroCoefficient + static_cast<float>(columns_.get_padded()) * kZeroResidual);
    };
    const auto try_one = [&](Fit fit, std::size_t fields, std::size_t begin, std::size_t end) {
      if (!(best.cost > find_least(fields))) return;
      fit_loops_.calc_products(columns_, begin, end, products_);
      if (Trial trial = try_fit(fit, fields, numbers.steps); trial.cost < best.cost) best = trial;
    };
    try_one(Fit::kGradient, kGradientFields, 0, Columns::kDifferences);
    try_one(Fit::kDifferences, kFields, Columns::kDifferences, Columns::kCount);
    predict(best, stencil, numbers);
    numbers.kinds.push_back({best.fit, add_residual(numbers), fineness_[v]});
  }

  /// Same arithmetic as read_shapes().
  void predict(const Trial& trial, const Stencil& stencil, LevelNumbers& numbers) {
    if (trial.fit == Fit::kNone) return loops_.add_weighted(from_.data(), stencil.value.data(), row_.size(), row_.data());
    const float unit = share_ / std::sqrt(1.0F + energy_);
    std::array<float, kGradientNumbers> of_gradient;
    std::array<float, kDifferenceNumbers> of_differences;
    // By field, then contribution, then component.
    const auto take = [&](std::size_t first, std::size_t fields, float step, std::span<float> scaled, std::vector<std::int32_t>& said) {
      std::size_t i = 0;
      for (std::size_t f = 0; f < fields; ++f)
        for (Eigen::Index to = 0; to < 3; ++to)
          for (std::size_t c = 0; c < 3; ++c) {
            const int number = trial.numbers(static_cast<Eigen::Index>(first + fields * c + f), to);
            said.push_back(number);
            scaled[i++] = step * unit * static_cast<float>(number);
          }
    };
    take(0, 3, numbers.steps.gradient, of_gradient, numbers.gradient);
    const bool is_wide = trial.fit == Fit::kDifferences;
    if (is_wide) take(kGradientFields, kNeighbours, numbers.steps.differences, of_differences, numbers.differences);
    Matrix matrix;
    loops_.calc_matrix(stencil, of_gradient.data(), is_wide ? of_differences.data() : nullptr, matrix);
    loops_.multiply(from_.data(), matrix.data(), columns_.get_padded(), row_.data());
  }

  /// Adds the quantised residual of the vertex to row_, and keeps the row and its shape. False if the residual is 0.
  bool add_residual(LevelNumbers& numbers) {
    const std::size_t padded = columns_.get_padded(), before = numbers.residual.size();
    numbers.residual.resize(before + 3 * modes_);
    std::int32_t* number = numbers.residual.data() + before;
    const float per_step = 1.0F / cost_.step;
    std::int32_t any = 0;
    for (std::size_t m = 0; m < modes_; ++m) {
      for (std::size_t c = 0; c < 3; ++c) {
        float& value = row_[c * padded + m];
        const float x = (wanted_[c * padded + m] - value) * per_step;
        const auto size = static_cast<std::int32_t>(std::min(std::abs(x) + cost_.rounding, kMaxSteps));
        *number = x < 0.0F ? -size : size;
        value += cost_.step * static_cast<float>(*number);
        any |= *number++;
      }
    }
    if (any == 0) numbers.residual.resize(before);
    if (!is_finest_) {
      rows_.append(row_);
      energies_.push_back(loops_.calc_energy(row_.data(), row_.size()));
    }
    loops_.round(row_.data(), factor_.data(), padded, shape_row_.data());
    shape_.insert(shape_.end(), shape_row_.begin(), shape_row_.begin() + static_cast<std::ptrdiff_t>(3 * modes_));
    return any != 0;
  }

  const Surface& surface_;
  std::span<const std::uint8_t> fineness_;
  std::span<const float> factor_;
  const GetRow& get_wanted_;
  std::size_t modes_;
  const Loops& loops_ = find_loops();
  const FitLoops& fit_loops_ = find_fit_loops();
  Rows rows_;                    // all levels but the finest
  std::vector<float> energies_;  // per row
  std::vector<float> wanted_, row_;
  std::vector<std::int16_t> shape_row_, shape_;
  bool is_finest_ = false;
  float level_step_ = 1.0F;
  // Of a vertex: its step over that of the level; mean square of the neighbours.
  float share_ = 1.0F, energy_ = 0.0F;
  std::array<const float*, kNeighbours> from_{};
  Columns columns_;
  Products products_{};
  ResidualCost cost_{.bits_of_0 = kZeroResidual, .bits_of_1 = kOneResidual, .per_error = kPerError};
};

}  // namespace

FittedShapes fit_shapes(const Surface& surface, std::size_t modes, std::span<const std::uint8_t> fineness, std::span<const float> factor,
                        const GetRow& get_wanted) {
  return Fitter(surface, modes, fineness, factor, get_wanted).run();
}

}  // namespace carillon::packed
