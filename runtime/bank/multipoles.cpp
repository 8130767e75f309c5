// Method:     h_l by its recurrence, upwards: where j_l falls, y_l grows and |h_l| with it, so that errors grow no faster than what is
//             sought. The factor e^{i x}, which all h_l have, is left out. A component that was rounded is off by half a step at most, a
//             coefficient by scale / sqrt(2); the root of the decay is a norm of the coefficients, so that it is off by no more than the
//             norm of these.
// Source:     DLMF 10.49.6, 10.51.1; docs/equations.md E10.
// Deviations: none.
#include "runtime/bank/multipoles.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "runtime/bank/bank.hpp"

namespace carillon::bank {

std::vector<double> calc_hankel_sizes(double x, std::int32_t order) {
  std::vector<double> sizes(static_cast<std::size_t>(order) + 1, std::numeric_limits<double>::infinity());
  std::complex<double> here(0.0, -1.0 / x), next(-1.0 / x, -1.0 / (x * x));
  for (std::size_t l = 0; l < sizes.size(); ++l) {
    const double size = std::abs(here);
    if (!std::isfinite(size)) break;
    sizes[l] = size;
    const std::complex<double> after = (2.0 * static_cast<double>(l) + 3.0) / x * next - here;
    here = next;
    next = after;
  }
  return sizes;
}

std::vector<CoefficientDecay> calc_coefficient_decays(const Multipoles& multipoles) {
  std::vector<CoefficientDecay> decays;
  const std::int16_t* steps = multipoles.coefficient.data();
  for (std::size_t m = 0; m < multipoles.order.size(); ++m) {
    const double omega = 2.0 * std::numbers::pi * multipoles.freq_hz[m];
    const auto sizes = calc_hankel_sizes(omega / multipoles.sound_speed_ms * multipoles.radius_m, multipoles.order[m]);
    double power = 0.0, rounding = 0.0;  // in steps
    for (std::size_t l = 0; l < sizes.size(); ++l) {
      double squares = 0.0;
      for (std::size_t i = 0; i < 2 * (2 * l + 1); ++i, ++steps) squares += static_cast<double>(*steps) * *steps;
      power += squares / (sizes[l] * sizes[l]);
      rounding += 0.5 * static_cast<double>(2 * l + 1) / (sizes[l] * sizes[l]);
    }
    // 1 / (2 rho c k^2)
    const double root = multipoles.scale[m] / omega * std::sqrt(multipoles.sound_speed_ms / (2.0 * multipoles.air_density_kg_m3));
    decays.push_back({root * root * power, root * std::sqrt(rounding)});
  }
  return decays;
}

void add_coefficients(Multipoles& multipoles, std::int32_t order, std::span<const std::complex<double>> coefficients) {
  if (order < 0 || order > kMaxOrder)
    throw InputError(fmt::format("multipoles of order {}; it must lie within 0 and {}", order, kMaxOrder));
  if (coefficients.size() != count_coefficients(order))
    throw InputError(
        fmt::format("{} coefficients of multipoles of order {}; give {}", coefficients.size(), order, count_coefficients(order)));
  double largest = 0.0;
  for (const std::complex<double>& a : coefficients) {
    if (!std::isfinite(a.real()) || !std::isfinite(a.imag()))
      throw InputError(fmt::format("a coefficient of the multipoles of mode {} is not finite; solve again", multipoles.order.size()));
    largest = std::max({largest, std::abs(a.real()), std::abs(a.imag())});
  }
  const double scale = calc_shape_scale(largest);
  multipoles.order.push_back(order);
  multipoles.scale.push_back(scale);
  for (const std::complex<double>& a : coefficients) {
    multipoles.coefficient.push_back(find_step(a.real(), scale));
    multipoles.coefficient.push_back(find_step(a.imag(), scale));
  }
}

Multipoles select_multipoles(const Multipoles& multipoles, const std::vector<std::size_t>& chosen) {
  if (chosen.empty() || multipoles.is_empty()) return {};
  std::vector<std::size_t> first{0};  // of the components of each mode
  for (const std::int32_t order : multipoles.order) first.push_back(first.back() + 2 * count_coefficients(order));
  Multipoles selected = multipoles;
  for (auto* values : {&selected.freq_hz, &selected.scale, &selected.decay_per_s, &selected.added_mass, &selected.error_db}) {
    const std::vector<double> all = std::exchange(*values, {});
    for (const std::size_t mode : chosen) values->push_back(all[mode]);
  }
  selected.order.clear();
  selected.coefficient.clear();
  for (const std::size_t mode : chosen) {
    selected.order.push_back(multipoles.order[mode]);
    const auto steps = multipoles.coefficient.begin();
    selected.coefficient.insert(selected.coefficient.end(), steps + static_cast<std::ptrdiff_t>(first[mode]),
                                steps + static_cast<std::ptrdiff_t>(first[mode + 1]));
  }
  return selected;
}

}  // namespace carillon::bank
