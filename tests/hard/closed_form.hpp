// One struck body and its closed form in long double.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <utility>
#include <vector>

#include "runtime/synth/resonator_bank.hpp"
#include "tests/unit/runtime/synth/cube_bank.hpp"

namespace carillon::hard {

using Real = long double;

/// q' of q'' + 2 d q' + lambda q = 0 a time after a unit impulse, whatever the damping.
inline Real calc_velocity(Real lambda, Real d, Real t) {
  if (t < 0) return 0;
  const Real s2 = (d - std::sqrt(lambda)) * (d + std::sqrt(lambda));
  const Real x = s2 * t * t;
  if (std::abs(x) < 0.1L) {  // series of cosh(s t) and sinh(s t) / (s t) in s^2 t^2
    Real c = 1, s = 1, term_c = 1, term_s = 1;
    for (int k = 1; k < 12; ++k) {
      term_c *= x / ((2 * k - 1) * (2 * k)), term_s *= x / ((2 * k) * (2 * k + 1));
      c += term_c, s += term_s;
    }
    return std::exp(-d * t) * (c - d * t * s);
  }
  if (s2 > 0) {
    const Real s = std::sqrt(s2), fast = d + s, slow = lambda / fast;
    return (fast * std::exp(-fast * t) - slow * std::exp(-slow * t)) / (2 * s);
  }
  const Real w = std::sqrt(-s2), phase = std::remainder(w * t, 2 * std::numbers::pi_v<Real>);
  return std::exp(-d * t) * (std::cos(phase) - d / w * std::sin(phase));
}

/// q' a time after a Hertz pulse of unit impulse began: its shape (sin^1.5, area by quadrature) against calc_velocity. An over-damped
/// answer dies within a sliver of the pulse, so the time before `t` is cut where the answer bends, ever finer towards `t`.
inline Real calc_pushed(Real lambda, Real d, Real t, Real length) {
  const auto shape = [](Real x) { return x > 0 && x < 1 ? std::pow(std::sin(std::numbers::pi_v<Real> * x), 1.5L) : 0.0L; };
  const Real area = 2 / std::numbers::pi_v<Real> * 0.8740191847640399368216L;  // of sin^1.5 over 0..pi: 1.748038369528079873643...
  const Real node[] = {0.1488743389816312108848L, 0.4333953941292471907993L, 0.6794095682990244062343L, 0.8650633666889845107321L,
                       0.9739065285171717200780L};
  const Real weight[] = {0.2955242247147528701739L, 0.2692667193099963550913L, 0.2190863625159820439955L, 0.1494513491505805931458L,
                         0.0666713443086881375936L};
  const auto panel = [&](Real a, Real b) {  // over the age of the push
    Real sum = 0;
    for (int k = 0; k < 5; ++k) {
      for (const Real side : {-1.0L, 1.0L}) {
        const Real age = 0.5L * (a + b) + side * 0.5L * (b - a) * node[k];
        sum += weight[k] * shape((t - age) / length) * calc_velocity(lambda, d, age);
      }
    }
    return 0.5L * (b - a) * sum;
  };
  const Real oldest = t, youngest = std::max(0.0L, t - length);
  if (oldest <= 0) return 0;
  // Panels of equal ratio near age 0, and near both ends of the pulse, where its slope has a kink.
  std::vector<Real> cuts{youngest, oldest};
  for (Real age = 1e-13L; age < oldest; age *= 1.4L) {
    for (const Real cut : {age, youngest + age, oldest - age}) {
      if (cut > youngest && cut < oldest) cuts.push_back(cut);
    }
  }
  for (int k = 1; k < 64; ++k) cuts.push_back(youngest + (oldest - youngest) * k / 64);
  std::sort(cuts.begin(), cuts.end());
  Real sum = 0;
  for (std::size_t i = 1; i < cuts.size(); ++i) sum += panel(cuts[i - 1], cuts[i]);
  return sum / (area * length);
}

/// (lambda [rad^2/s^2], decay [1/s]) of each mode.
using Modes = std::vector<std::pair<double, double>>;

/// A bank whose modes have these eigenvalues and decays exactly; all are struck alike.
inline bank::Bank make_bank(const Modes& lambda_and_decay) {
  std::vector<testing::InventedMode> modes(lambda_and_decay.size(), {1.0, 0.0});
  bank::Bank bank = testing::make_cube_bank(modes);
  for (std::size_t m = 0; m < modes.size(); ++m) {
    bank.eigenvalue_rad2_s2[m] = lambda_and_decay[m].first;
    bank.decay_per_s[m] = lambda_and_decay[m].second;
  }
  return bank;
}

inline double to_lambda(double freq_hz) { return 4.0 * std::numbers::pi * std::numbers::pi * freq_hz * freq_hz; }

/// An ideal impulse of so many N s at the first sample.
inline void strike(synth::ResonatorBank& voice, double impulse_n_s = 1.0) {
  ASSERT_TRUE(voice.strike({.impulse_n_s = {0.0, 0.0, impulse_n_s}}));
}

inline std::vector<float> play(synth::ResonatorBank& voice, std::size_t samples) {
  std::vector<float> out(samples, 0.0F);
  voice.process(out);
  return out;
}

/// Largest difference to the sum of the modes' closed forms, over the sum of their amplitudes at the sample that they have lost least.
inline double calc_error(const std::vector<float>& heard, std::int64_t first, double rate_hz, const Modes& modes) {
  Real largest = 0, peak = 0;
  for (std::size_t n = 0; n < heard.size(); ++n) {
    const Real t = static_cast<Real>(first + static_cast<std::int64_t>(n)) / static_cast<Real>(rate_hz);
    Real sum = 0, size = 0;
    for (const auto& [lambda, decay] : modes) sum += calc_velocity(lambda, decay, t), size += std::exp(-static_cast<Real>(decay) * t);
    largest = std::max(largest, std::abs(static_cast<Real>(heard[n]) - sum));
    peak = std::max(peak, size);
  }
  return static_cast<double>(largest / peak);
}

}  // namespace carillon::hard
