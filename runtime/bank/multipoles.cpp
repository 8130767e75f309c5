// Method: h_l by recurrence (runtime/base/hankel.hpp). A rounded component is off by at most half a step, a coefficient by scale / sqrt(2);
//   the root of the decay is a norm of the coefficients, so its error is at most the norm of theirs.
// Source: DLMF 10.49.6, 10.51.1; docs/equations.md E10.
#include "runtime/bank/multipoles.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "runtime/bank/air.hpp"
#include "runtime/bank/bank.hpp"
#include "runtime/bank/mixing.hpp"
#include "runtime/base/hankel.hpp"

namespace carillon::bank {

std::vector<double> calc_hankel_sizes(double x, std::int32_t order) {
  std::vector<double> sizes;
  for (const std::complex<double>& quotient : base::calc_hankel_quotients(x, order))
    sizes.push_back(sizes.empty() ? 1.0 / x : sizes.back() / std::abs(quotient));
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

bool is_half_space(const Multipoles& multipoles) {
  double carried = 0.0, lost = 0.0;
  for (const CoefficientDecay& found : calc_coefficient_decays(multipoles)) carried += found.decay_per_s;
  for (const double decay : multipoles.decay_per_s) lost += decay;
  return carried > 1.5 * lost && carried < 2.5 * lost;
}

std::vector<double> calc_far_gains(const Multipoles& multipoles) {
  const double share = is_half_space(multipoles) ? 2.0 : 1.0;
  std::vector<double> gains;
  for (const double decay : multipoles.decay_per_s)
    gains.push_back(calc_gain_of_decay(share * decay, multipoles.air_density_kg_m3, multipoles.sound_speed_ms));
  return gains;
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

void scale_size(Multipoles& multipoles, double g) {
  for (double& x : multipoles.centre_m) x *= g;
  multipoles.radius_m *= g;
  multipoles.nearest_m *= g;
  for (std::size_t m = 0; m < multipoles.order.size(); ++m) {
    multipoles.freq_hz[m] /= g;
    multipoles.scale[m] /= std::sqrt(g * g * g);
    multipoles.decay_per_s[m] /= g;
  }
}

namespace {

Mixing select_mixing(const Multipoles& multipoles, const std::vector<std::size_t>& chosen) {
  const Mixing& mixing = multipoles.mixing;
  if (mixing.is_empty()) return {};
  const std::size_t modes = mixing.count.size();
  std::vector<std::int32_t> place(modes + kRigidMotions, -1);
  for (std::size_t i = 0; i < chosen.size(); ++i) place[chosen[i]] = static_cast<std::int32_t>(i);
  for (std::size_t r = 0; r < kRigidMotions; ++r) place[modes + r] = static_cast<std::int32_t>(chosen.size() + r);
  std::vector<std::size_t> first{0};
  for (const std::int32_t count : mixing.count) first.push_back(first.back() + static_cast<std::size_t>(count));
  Mixing selected;
  for (const std::size_t mode : chosen) {
    std::vector<std::pair<std::int32_t, double>> parts;
    double squares = 0.0;
    for (std::size_t k = first[mode]; k < first[mode + 1]; ++k) {
      const std::int32_t motion = place[mixing.motion[k]];
      if (motion < 0) continue;
      parts.emplace_back(motion, mixing.part[k]);
      squares += mixing.part[k] * mixing.part[k];
    }
    const bool is_whole = parts.size() == first[mode + 1] - first[mode];
    std::sort(parts.begin(), parts.end());
    if (squares == 0.0) parts = {{place[mode], squares = 1.0}};  // all parts of the mode were dropped
    const double factor = is_whole ? 1.0 : 1.0 / std::sqrt(squares * (1.0 + multipoles.added_mass[mode]));
    for (const auto& [motion, part] : parts) {
      selected.motion.push_back(motion);
      selected.part.push_back(factor * part);
    }
    selected.count.push_back(static_cast<std::int32_t>(parts.size()));
  }
  return selected;
}

}  // namespace

Multipoles select_multipoles(const Multipoles& multipoles, const std::vector<std::size_t>& chosen) {
  if (chosen.empty() || multipoles.is_empty()) return {};
  std::vector<std::size_t> first{0};  // first component of each mode
  for (const std::int32_t order : multipoles.order) first.push_back(first.back() + 2 * count_coefficients(order));
  Multipoles selected = multipoles;
  for (auto* values : {&selected.freq_hz, &selected.scale, &selected.decay_per_s, &selected.added_mass, &selected.error_db}) {
    const std::vector<double> all = std::exchange(*values, {});
    for (const std::size_t mode : chosen) values->push_back(all[mode]);
  }
  selected.mixing = select_mixing(multipoles, chosen);
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
