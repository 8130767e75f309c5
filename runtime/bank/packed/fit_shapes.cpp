#include "runtime/bank/packed/fit_shapes.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>

#include "runtime/bank/packed/loops.hpp"
#include "runtime/bank/packed/neighbours.hpp"
#include "runtime/bank/packed/stencil.hpp"

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
constexpr int kGradients = 9, kFeatures = 9 + 3 * static_cast<int>(kNeighbours);
constexpr float kMaxSteps = 1e9F;  // limit of a number; the finest steps are 46,000 times smaller than those of the level

using Field = Eigen::Matrix<float, Eigen::Dynamic, 3>;  // (padded, 3): a row of Rows in memory order
using FieldMap = Eigen::Map<const Field>;

template <std::size_t N>
float find_of_level(const std::array<float, N>& values, std::size_t from_finest) {
  return values[std::min(from_finest, N - 1)];
}

/// Bits of a number other than 0, without the constant.
float calc_size_bits(float q) { return 2.0F * std::log2(q); }

/// Neighbourhood of a vertex. Columns: gradient along j of component c at 3 c + j, then the difference of neighbour k at
/// kGradients + kNeighbours c + k.
struct Features {
  Field value;             // prediction by kriging alone
  Eigen::MatrixXf fields;  // (padded, kFeatures)
  float energy = 0.0F;     // mean square of the neighbours
};

class Fitter {
 public:
  Fitter(const Surface& surface, const Rows& wanted, std::size_t modes, std::span<const std::uint8_t> fineness)
      : surface_(surface),
        fineness_(fineness),
        wanted_(wanted),
        modes_(modes),
        padded_(static_cast<Eigen::Index>(wanted.get_padded())),
        rows_(surface.places.size(), modes),
        row_(wanted.get_width()) {}

  FittedShapes run(std::size_t sampled) {
    sampled_ = sampled;
    std::vector<LevelNumbers> levels;
    for (std::size_t level = 0; level < surface_.level_count(); ++level) levels.push_back(fit_level(level));
    return {std::move(levels), std::move(rows_)};
  }

 private:
  /// One candidate prediction of a vertex: coefficients and residual.
  struct Trial {
    Fit fit = Fit::kNone;
    Eigen::MatrixXi numbers;  // (features, 3)
    float cost = 0.0F;        // bits plus weighted error
  };

  void begin_vertex(std::size_t v) {
    share_ = LevelSteps::calc_share(fineness_[v]);
    step_ = share_ * level_step_;
  }

  LevelNumbers fit_level(std::size_t level) {
    const std::size_t first = surface_.level_begin[level], end = surface_.level_begin[level + 1];
    const std::size_t from_finest = surface_.level_count() - 1 - level;
    level_step_ = step_ = find_of_level(kResidualSteps, from_finest);
    rounding_ = find_of_level(kRounding, from_finest);
    LevelNumbers numbers;
    numbers.steps.residual = level_step_;
    if (level == 0) {
      for (std::size_t v = first; v < end; ++v) {
        std::fill(row_.begin(), row_.end(), 0.0F);
        begin_vertex(v);
        numbers.kinds.push_back({Fit::kNone, add_residual(v, numbers), fineness_[v]});
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
    for (std::size_t v = first; v < end; ++v) {
      if (from_finest > 0 || v % sampled_ == 0) {
        fit_vertex(v, neighbours[v - first], stencils[v - first], numbers);
      } else {
        std::fill(row_.begin(), row_.end(), 0.0F);
        rows_.append(row_);
      }
    }
    return numbers;
  }

  void calc_features(const Neighbours& neighbours, const Stencil& stencil) {
    constexpr auto n = static_cast<Eigen::Index>(kNeighbours);
    Eigen::Matrix<float, n, 1> value;
    Eigen::Matrix<float, n, 3> gradient;
    Eigen::Matrix<float, 3, n> offset;
    for (Eigen::Index k = 0; k < n; ++k) {
      const std::size_t i = k;
      value[k] = stencil.value[i];
      for (std::size_t j = 0; j < 3; ++j) {
        gradient(k, static_cast<Eigen::Index>(j)) = stencil.gradient[j][i];
        offset(static_cast<Eigen::Index>(j), k) = stencil.offset[j][i];
      }
    }
    const Eigen::Matrix<float, n, n> difference =
        Eigen::Matrix<float, n, n>::Identity() - value * Eigen::Matrix<float, 1, n>::Ones() - gradient * offset;
    features_.value.resize(padded_, 3);
    features_.fields.resize(padded_, kFeatures);
    features_.energy = 0.0F;
    for (Eigen::Index c = 0; c < 3; ++c) {
      gathered_.resize(padded_, n);
      for (Eigen::Index k = 0; k < n; ++k)
        gathered_.col(k) = FieldMap(rows_.get(static_cast<std::size_t>(neighbours[k])), padded_, 3).col(c);
      features_.energy += gathered_.squaredNorm() / static_cast<float>(kNeighbours);
      features_.value.col(c).noalias() = gathered_ * value;
      features_.fields.middleCols(3 * c, 3).noalias() = gathered_ * gradient;
      features_.fields.middleCols(kGradients + n * c, n).noalias() = gathered_ * difference;
    }
  }

  /// Coefficient steps whose rounding changes the prediction by kCoefficientStep of the residual's step on average.
  void set_coefficient_steps(const std::vector<Neighbours>& neighbours, const std::vector<Stencil>& stencils, LevelSteps& steps) {
    double gradient = 0.0, differences = 0.0, count = 0.0;
    const std::size_t stride = std::max<std::size_t>(neighbours.size() / kFeatureSamples, 1);
    for (std::size_t i = 0; i < neighbours.size(); i += stride) {
      calc_features(neighbours[i], stencils[i]);
      const auto calc_log = [&](Eigen::Index first, Eigen::Index columns) {
        const double mean = static_cast<double>(features_.fields.middleCols(first, columns).squaredNorm()) / static_cast<double>(columns);
        return std::log((1.0 + static_cast<double>(features_.energy)) / std::max(mean, 1e-6));
      };
      gradient += calc_log(0, kGradients);
      differences += calc_log(kGradients, kFeatures - kGradients);
      count += 1.0;
    }
    const double error = kCoefficientStep * static_cast<double>(level_step_) * std::sqrt(static_cast<double>(modes_));
    steps.gradient = static_cast<float>(error / std::sqrt(kGradients) * std::exp(0.5 * gradient / count));
    steps.differences = static_cast<float>(error / std::sqrt(kFeatures) * std::exp(0.5 * differences / count));
  }

  /// Bits of the residual plus weighted error.
  float calc_cost(const Field& left) const {
    float bits = 0.0F, error = 0.0F;
    const float per_step = 1.0F / step_;
    for (Eigen::Index c = 0; c < 3; ++c) {
      for (Eigen::Index m = 0; m < static_cast<Eigen::Index>(modes_); ++m) {
        const float x = std::abs(left(m, c)) * per_step, q = std::floor(x + rounding_);
        bits += q > 0.0F ? kOneResidual + calc_size_bits(q) : kZeroResidual;
        error += (x - q) * (x - q);
      }
    }
    return bits + kPerError * error;
  }

  Trial try_fit(Fit fit, const Field& left, const Eigen::MatrixXd& gram, const Eigen::MatrixXd& right, const LevelSteps& steps) const {
    const Eigen::Index count = gram.rows();
    const double unit = static_cast<double>(share_) / std::sqrt(1.0 + static_cast<double>(features_.energy));
    Eigen::VectorXd step(count);
    for (Eigen::Index j = 0; j < count; ++j) step[j] = unit * static_cast<double>(j < kGradients ? steps.gradient : steps.differences);
    Eigen::MatrixXd regular = gram;
    for (Eigen::Index j = 0; j < count; ++j) {
      const double weight = static_cast<double>(step_) / step[j];
      regular(j, j) += kPrior * weight * weight + 1e-12;
    }
    const Eigen::LLT<Eigen::MatrixXd> factor(regular);
    const Eigen::MatrixXd upper = factor.matrixU();
    const Eigen::MatrixXd target = factor.matrixL().solve(right);
    Trial trial{fit, Eigen::MatrixXi(count, 3), 0.0F};
    Eigen::MatrixXd coefficients(count, 3);
    for (Eigen::Index to = 0; to < 3; ++to) {
      for (Eigen::Index j = count; j-- > 0;) {
        const Eigen::Index rest = count - 1 - j;
        const double x = (target(j, to) - upper.row(j).tail(rest).dot(coefficients.col(to).tail(rest))) / upper(j, j);
        const double rounded = std::clamp(std::nearbyint(x / step[j]), -static_cast<double>(kMaxSteps), static_cast<double>(kMaxSteps));
        trial.numbers(j, to) = static_cast<int>(rounded);
        coefficients(j, to) = rounded * step[j];
        trial.cost += rounded == 0.0 ? kZeroCoefficient : kOneCoefficient + calc_size_bits(static_cast<float>(std::abs(rounded)));
      }
    }
    const Field rest = left - features_.fields.leftCols(count) * coefficients.cast<float>();
    trial.cost += calc_cost(rest);
    return trial;
  }

  void fit_vertex(std::size_t v, const Neighbours& neighbours, const Stencil& stencil, LevelNumbers& numbers) {
    calc_features(neighbours, stencil);
    begin_vertex(v);
    const Field left = FieldMap(wanted_.get(v), padded_, 3) - features_.value;
    Trial best{Fit::kNone, {}, calc_cost(left)};
    // Lower bound of a trial's cost: all coefficients and residuals are 0.
    const auto find_least = [&](int features) {
      return 3.0F * (static_cast<float>(features) * kZeroCoefficient + static_cast<float>(modes_) * kZeroResidual);
    };
    if (best.cost > find_least(kGradients)) {
      const auto try_one = [&](Fit fit, int count) {
        const auto fields = features_.fields.leftCols(count);
        gram_.setZero(count, count);
        gram_.selfadjointView<Eigen::Lower>().rankUpdate(fields.transpose());
        const Eigen::MatrixXd gram = Eigen::MatrixXf(gram_.selfadjointView<Eigen::Lower>()).cast<double>();
        Trial trial = try_fit(fit, left, gram, (fields.transpose() * left).cast<double>(), numbers.steps);
        if (trial.cost < best.cost) best = std::move(trial);
      };
      try_one(Fit::kGradient, kGradients);
      if (best.cost > find_least(kFeatures)) try_one(Fit::kDifferences, kFeatures);
    }
    predict(best, neighbours, stencil, numbers);
    numbers.kinds.push_back({best.fit, add_residual(v, numbers), fineness_[v]});
  }

  /// Same arithmetic as read_shapes().
  void predict(const Trial& trial, const Neighbours& neighbours, const Stencil& stencil, LevelNumbers& numbers) {
    std::array<const float*, kNeighbours> from;
    for (std::size_t k = 0; k < kNeighbours; ++k) from[k] = rows_.get(static_cast<std::size_t>(neighbours[k]));
    if (trial.fit == Fit::kNone) return loops_.add_weighted(from.data(), stencil.value.data(), row_.size(), row_.data());
    const float unit = share_ / std::sqrt(1.0F + features_.energy);
    std::array<float, kGradientNumbers> of_gradient;
    std::array<float, kDifferenceNumbers> of_differences;
    // By field, then contribution, then component.
    const auto take = [&](Eigen::Index first, Eigen::Index fields, float step, std::span<float> scaled, std::vector<std::int32_t>& said) {
      std::size_t i = 0;
      for (Eigen::Index f = 0; f < fields; ++f)
        for (Eigen::Index to = 0; to < 3; ++to)
          for (Eigen::Index c = 0; c < 3; ++c) {
            const int number = trial.numbers(first + fields * c + f, to);
            said.push_back(number);
            scaled[i++] = step * unit * static_cast<float>(number);
          }
    };
    take(0, 3, numbers.steps.gradient, of_gradient, numbers.gradient);
    const bool is_wide = trial.fit == Fit::kDifferences;
    if (is_wide) take(kGradients, static_cast<Eigen::Index>(kNeighbours), numbers.steps.differences, of_differences, numbers.differences);
    Matrix matrix;
    loops_.calc_matrix(stencil, of_gradient.data(), is_wide ? of_differences.data() : nullptr, matrix);
    loops_.multiply(from.data(), matrix.data(), static_cast<std::size_t>(padded_), row_.data());
  }

  /// Adds the quantised residual of the vertex to row_ and keeps the row. False if the residual is 0.
  bool add_residual(std::size_t v, LevelNumbers& numbers) {
    const std::size_t padded = padded_;
    const float* wanted = wanted_.get(v);
    const std::size_t before = numbers.residual.size();
    bool is_any = false;
    for (std::size_t m = 0; m < modes_; ++m) {
      for (std::size_t c = 0; c < 3; ++c) {
        float& value = row_[c * padded + m];
        const float x = (wanted[c * padded + m] - value) / step_;
        const float size = std::min(std::floor(std::abs(x) + rounding_), kMaxSteps);
        const float q = std::copysign(size, x);
        value += step_ * q;
        is_any = is_any || size > 0.0F;
        numbers.residual.push_back(static_cast<std::int32_t>(q));
      }
    }
    if (!is_any) numbers.residual.resize(before);
    rows_.append(row_);
    return is_any;
  }

  const Surface& surface_;
  std::span<const std::uint8_t> fineness_;
  const Rows& wanted_;
  std::size_t modes_, sampled_ = 1;
  Eigen::Index padded_;
  const Loops& loops_ = find_loops();
  Rows rows_;
  std::vector<float> row_;
  Features features_;
  Eigen::MatrixXf gathered_, gram_;
  float level_step_ = 1.0F, rounding_ = 0.5F;  // per level
  float share_ = 1.0F, step_ = 1.0F;           // per vertex: its steps are `share_` of the level's
};

}  // namespace

FittedShapes fit_shapes(const Surface& surface, const Rows& wanted, std::size_t modes, std::span<const std::uint8_t> fineness,
                        std::size_t sampled) {
  return Fitter(surface, wanted, modes, fineness).run(sampled);
}

}  // namespace carillon::packed
