// Method: sums in double precision. A truncation keeps the rows and columns of the kept modes: a sum of squares remains one.
//   phi scales with s^(-1/2) g^(-3/2) for density s and size g, a gradient has one length less, and eta is the root of an energy: stress
//   sqrt(volume / modulus) . strain, sqrt(k) g^(3/2) for stiffness k. So gradient scales with s^(-1/2) g^(-5/2), stress with k^(1/2)
//   g^(3/2), A with k^(1/2) s^-1 g^(-7/2); linear with a frequency, (k / s)^(1/2) / g.
// Source: docs/equations.md E12.
#include "runtime/bank/quartic_energy.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <type_traits>
#include <utility>

namespace carillon::bank {
namespace {

/// Values of a row at q [J^1/2]: eta and l.
struct RowValue {
  double eta = 0.0, linear = 0.0;
};

RowValue calc_linear(const QuarticEnergy& energy, std::size_t r, std::span<const double> q) {
  RowValue value;
  for (std::size_t i = 0; i < q.size() && !energy.linear.empty(); ++i) value.linear += energy.linear[r * q.size() + i] * q[i];
  return value;
}

void add_linear(const QuarticEnergy& energy, std::size_t r, double eta, std::span<double> gradient) {
  for (std::size_t i = 0; i < gradient.size() && !energy.linear.empty(); ++i) gradient[i] += energy.linear[r * gradient.size() + i] * eta;
}

double add_rows(const QuarticEnergy& energy, std::span<const double> q, std::span<double> gradient) {
  const std::size_t n = q.size();
  std::vector<double> forces(n);
  double sum = 0.0;
  for (std::size_t r = 0; r < energy.row_count(); ++r) {
    const float* a = energy.rows.data() + r * count_pairs(n);
    RowValue value = calc_linear(energy, r, q);
    std::fill(forces.begin(), forces.end(), 0.0);
    for (std::size_t j = 0; j < n; ++j)
      for (std::size_t i = 0; i <= j; ++i, ++a) {
        const double entry = static_cast<double>(*a);
        value.eta += (i == j ? 1.0 : 2.0) * entry * q[i] * q[j];
        forces[i] += 2.0 * entry * q[j];
        if (i != j) forces[j] += 2.0 * entry * q[i];
      }
    sum += value.linear * value.eta + 0.5 * value.eta * value.eta;
    for (std::size_t i = 0; i < n; ++i) gradient[i] += (value.linear + value.eta) * forces[i];
    add_linear(energy, r, value.eta, gradient);
  }
  return sum;
}

/// Index pairs of the strain components; diagonal ones count half.
constexpr std::array<std::array<std::size_t, 2>, 3> kSheetPairs{{{0, 0}, {1, 1}, {0, 1}}};
constexpr std::array<std::array<std::size_t, 2>, 6> kSolidPairs{{{0, 0}, {1, 1}, {2, 2}, {1, 2}, {0, 2}, {0, 1}}};

double add_points(const QuarticEnergy& energy, std::span<const double> q, std::span<double> gradient) {
  const std::size_t n = q.size(), points = energy.point_count(), parts = energy.gradient_count(), strains = energy.strain_count();
  const std::size_t axes = parts / 3;
  const auto pair_of = [&](std::size_t s) { return parts == 6 ? kSheetPairs[s] : kSolidPairs[s]; };
  std::vector<double> g(points * parts), strain(points * strains), pull(points * strains);
  for (std::size_t row = 0; row < g.size(); ++row)
    for (std::size_t i = 0; i < n; ++i) g[row] += static_cast<double>(energy.gradient[row * n + i]) * q[i];
  for (std::size_t p = 0; p < points; ++p)
    for (std::size_t s = 0; s < strains; ++s) {
      const auto [a, b] = pair_of(s);
      double product = 0.0;
      for (std::size_t k = 0; k < 3; ++k) product += g[p * parts + k * axes + a] * g[p * parts + k * axes + b];
      strain[p * strains + s] = (a == b ? 0.5 : 1.0) * product;
    }
  double sum = 0.0;
  for (std::size_t r = 0; r < energy.row_count(); ++r) {
    const float* stress = energy.stress.data() + r * strain.size();
    RowValue value = calc_linear(energy, r, q);
    for (std::size_t i = 0; i < strain.size(); ++i) value.eta += energy.weight[i / strains] * static_cast<double>(stress[i]) * strain[i];
    sum += value.linear * value.eta + 0.5 * value.eta * value.eta;
    for (std::size_t i = 0; i < strain.size(); ++i)
      pull[i] += (value.linear + value.eta) * energy.weight[i / strains] * static_cast<double>(stress[i]);
    add_linear(energy, r, value.eta, gradient);
  }
  std::vector<double> back(g.size());
  for (std::size_t p = 0; p < points; ++p)
    for (std::size_t s = 0; s < strains; ++s) {
      const auto [a, b] = pair_of(s);
      for (std::size_t k = 0; k < 3; ++k) {
        back[p * parts + k * axes + a] += pull[p * strains + s] * g[p * parts + k * axes + b];
        if (a != b) back[p * parts + k * axes + b] += pull[p * strains + s] * g[p * parts + k * axes + a];
      }
    }
  for (std::size_t row = 0; row < g.size(); ++row)
    for (std::size_t i = 0; i < n; ++i) gradient[i] += static_cast<double>(energy.gradient[row * n + i]) * back[row];
  return sum;
}

}  // namespace

std::size_t QuarticEnergy::row_count() const {
  if (is_empty()) return 0;
  return is_of_points() ? stress.size() / (point_count() * strain_count()) : rows.size() / count_pairs(mode_count());
}

std::string find_mode_fault(const QuarticEnergy& energy, std::size_t modes) {
  for (std::size_t i = 0; i < energy.mode_count(); ++i) {
    const std::int32_t mode = energy.modes[i];
    if (mode < 0 || static_cast<std::size_t>(mode) >= modes || (i > 0 && mode <= energy.modes[i - 1]))
      return fmt::format("nonlinear/modes[{}] is {}; numbers of the bank's {} modes are wanted, ascending", i, mode, modes);
  }
  return {};
}

std::string find_size_fault(const QuarticEnergy& energy) {
  const std::size_t n = energy.mode_count(), points = energy.point_count();
  if (n == 0) {
    const bool has_arrays = !energy.rows.empty() || !energy.gradient.empty() || !energy.stress.empty() || points > 0;
    return has_arrays || !energy.linear.empty() ? "nonlinear/modes is empty, and there are arrays for coupled modes" : "";
  }
  if (n > kMaxCoupledModes) return fmt::format("nonlinear/modes names {} modes, and {} are the most", n, kMaxCoupledModes);
  std::size_t rows = 0;
  if (points > 0) {
    if (!energy.rows.empty()) return "nonlinear/A and nonlinear/G are both there; one form is wanted";
    const std::size_t parts = energy.gradient.size() / (points * n), strains = parts == 6 ? 3 : 6;
    if ((parts != 6 && parts != 9) || energy.gradient.size() != points * parts * n)
      return fmt::format("arrays disagree: nonlinear/G holds {} values, not 6 or 9 for each of {} points and {} modes",
                         energy.gradient.size(), points, n);
    rows = energy.stress.size() / (points * strains);
    if (rows == 0 || energy.stress.size() != rows * points * strains)
      return fmt::format("arrays disagree: nonlinear/stress holds {} values, no multiple of {}", energy.stress.size(), points * strains);
  } else {
    if (!energy.gradient.empty() || !energy.stress.empty()) return "nonlinear/weight has no points, and there are arrays for them";
    rows = energy.rows.size() / count_pairs(n);
    if (rows == 0 || energy.rows.size() != rows * count_pairs(n))
      return fmt::format("arrays disagree: nonlinear/A holds {} values, no multiple of {}", energy.rows.size(), count_pairs(n));
  }
  if (rows > kMaxQuarticRows) return fmt::format("the nonlinear energy has {} rows, and {} are the most", rows, kMaxQuarticRows);
  if (!energy.linear.empty() && energy.linear.size() != rows * n)
    return fmt::format("arrays disagree: nonlinear/linear holds {} values and {} are wanted", energy.linear.size(), rows * n);
  return {};
}

double calc_energy_j(const QuarticEnergy& energy, std::span<const double> q, std::span<double> gradient) {
  std::fill(gradient.begin(), gradient.end(), 0.0);
  return energy.is_of_points() ? add_points(energy, q, gradient) : add_rows(energy, q, gradient);
}

std::vector<double> calc_self_coupling(const QuarticEnergy& energy) {
  const std::size_t n = energy.mode_count();
  std::vector<double> squares;
  if (!energy.is_of_points()) {
    squares.resize(n);
    for (std::size_t r = 0; r < energy.row_count(); ++r)
      for (std::size_t i = 0; i < n; ++i) {
        const auto diagonal = static_cast<double>(energy.rows[r * count_pairs(n) + find_pair(i, i)]);
        squares[i] += diagonal * diagonal;
      }
    return squares;
  }
  QuarticEnergy flat = energy;
  flat.linear.clear();
  std::vector<double> q(n), gradient(n);
  for (std::size_t i = 0; i < n; ++i) {
    q[i] = 1.0;
    squares.push_back(2.0 * calc_energy_j(flat, q, gradient));
    q[i] = 0.0;
  }
  return squares;
}

QuarticEnergy select_coupled(const QuarticEnergy& energy, const std::vector<std::size_t>& chosen) {
  const std::size_t n = energy.mode_count(), rows = energy.row_count();
  std::vector<std::pair<std::int32_t, std::size_t>> kept;  // index in the new bank, index among the coupled modes
  for (std::size_t to = 0; to < chosen.size(); ++to) {
    const auto at = std::lower_bound(energy.modes.begin(), energy.modes.end(), static_cast<std::int32_t>(chosen[to]));
    if (at != energy.modes.end() && static_cast<std::size_t>(*at) == chosen[to])
      kept.emplace_back(static_cast<std::int32_t>(to), static_cast<std::size_t>(at - energy.modes.begin()));
  }
  if (kept.empty()) return {};
  QuarticEnergy selected = energy;
  for (auto* values : {&selected.rows, &selected.gradient}) values->clear();
  selected.linear.clear();
  selected.modes.clear();
  for (const auto& [mode, place] : kept) selected.modes.push_back(mode);
  for (std::size_t r = 0; r < rows && !energy.rows.empty(); ++r) {
    const float* a = energy.rows.data() + r * count_pairs(n);
    for (std::size_t j = 0; j < kept.size(); ++j)
      for (std::size_t i = 0; i <= j; ++i) {
        const auto [low, high] = std::minmax(kept[i].second, kept[j].second);
        selected.rows.push_back(a[find_pair(low, high)]);
      }
  }
  for (std::size_t row = 0; row < energy.gradient.size() / n; ++row)
    for (const auto& [mode, place] : kept) selected.gradient.push_back(energy.gradient[row * n + place]);
  for (std::size_t r = 0; r < energy.linear.size() / n; ++r)
    for (const auto& [mode, place] : kept) selected.linear.push_back(energy.linear[r * n + place]);
  return selected;
}

void scale_frequencies(QuarticEnergy& energy, std::span<const double> factor) {
  const std::size_t n = energy.mode_count();
  const auto get_factor = [&](std::size_t i) { return factor[energy.modes[i]]; };
  for (std::size_t at = 0; at < energy.rows.size();)
    for (std::size_t j = 0; j < n; ++j)
      for (std::size_t i = 0; i <= j; ++i, ++at)
        energy.rows[at] = static_cast<float>(static_cast<double>(energy.rows[at]) * std::sqrt(get_factor(i) * get_factor(j)));
  for (std::size_t at = 0; at < energy.gradient.size(); ++at)
    energy.gradient[at] = static_cast<float>(static_cast<double>(energy.gradient[at]) * std::sqrt(get_factor(at % n)));
  for (std::size_t at = 0; at < energy.linear.size(); ++at) energy.linear[at] *= get_factor(at % n);
}

void combine_modes(QuarticEnergy& energy, std::span<const double> parts) {
  const std::size_t n = energy.mode_count();
  // Each row of `values` has n numbers; transforms it to the new modes.
  const auto combine = [&](auto& values) {
    std::vector<double> old(n);
    for (std::size_t row = 0; row < values.size() / n; ++row) {
      for (std::size_t j = 0; j < n; ++j) old[j] = static_cast<double>(values[row * n + j]);
      for (std::size_t i = 0; i < n; ++i) {
        double sum = 0.0;
        for (std::size_t j = 0; j < n; ++j) sum += parts[i * n + j] * old[j];
        values[row * n + i] = static_cast<std::remove_reference_t<decltype(values[0])>>(sum);
      }
    }
  };
  combine(energy.gradient);
  combine(energy.linear);
  std::vector<double> whole(n * n), turned(n * n);
  for (std::size_t r = 0; r < energy.row_count() && !energy.is_of_points(); ++r) {
    float* a = energy.rows.data() + r * count_pairs(n);
    for (std::size_t j = 0; j < n; ++j)
      for (std::size_t i = 0; i <= j; ++i) whole[i * n + j] = whole[j * n + i] = static_cast<double>(a[find_pair(i, j)]);
    combine(whole);
    for (std::size_t i = 0; i < n; ++i)
      for (std::size_t j = 0; j < n; ++j) turned[j * n + i] = whole[i * n + j];
    combine(turned);
    for (std::size_t j = 0; j < n; ++j)
      for (std::size_t i = 0; i <= j; ++i) a[find_pair(i, j)] = static_cast<float>(turned[i * n + j]);
  }
}

void scale_energy(QuarticEnergy& energy, double density, double stiffness, double size) {
  const double root = std::sqrt(stiffness);
  const auto scale = [](std::vector<float>& values, double factor) {
    for (float& value : values) value = static_cast<float>(static_cast<double>(value) * factor);
  };
  scale(energy.rows, root / density * std::pow(size, -3.5));
  scale(energy.gradient, std::pow(size, -2.5) / std::sqrt(density));
  scale(energy.stress, root * std::pow(size, 1.5));
  for (double& value : energy.linear) value *= root / std::sqrt(density) / size;
  energy.rest_energy_j *= stiffness * size * size * size;
  energy.thickness_m *= size;
}

}  // namespace carillon::bank
