// Method:     the exact answer of a mode to a force that is constant over each interval, as a real recursion: after a step of force q' is
//             e^{-d t} sin(omega_d t) / omega_d, which is the impulse response of y[n] = a1 y[n-1] + a2 y[n-2] + x[n], a1 = 2 Re c, a2 =
//             -|c|^2, c = e^{(-d + i omega_d) h}. So x is the change of the force from one interval to the next, worked out once for all
//             modes, and the pressure is the sum of g phi e^{-d h} sin(omega_d h) / omega_d times y: three multiply-adds a mode.
// Source:     docs/equations.md E4.
// Deviations: none.
#include "runtime/synth/driven_bank.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "runtime/config/error.hpp"
#include "runtime/synth/fp_guard.hpp"

namespace carillon::synth {
namespace {

// Below, the coefficients of a float recursion are off by more than 0.01 cent at 48 kHz.
constexpr double kLowestFloatRad = 2.0 * std::numbers::pi * 1000.0 / 48000.0;

/// Appends a mode to groups that are filled one after the other.
template <typename Number>
void add(std::vector<FilterGroup<Number>>& groups, int& count, double a1, double a2, double gain) {
  const int lane = count++ % kGroup;
  if (lane == 0) groups.push_back(FilterGroup<Number>{});
  groups.back().a1[lane] = static_cast<Number>(a1);
  groups.back().a2[lane] = static_cast<Number>(a2);
  groups.back().gain[lane] = static_cast<Number>(gain);
}

}  // namespace

DrivenBank::DrivenBank(const Model& model, std::int32_t triangle, const bank::Vec3& barycentric, const bank::Vec3& direction, Isa isa)
    : kernels_(&get_kernels(isa)) {
  for (const double x : {barycentric[0], barycentric[1], barycentric[2], direction[0], direction[1], direction[2]}) {
    if (!std::isfinite(x)) throw InputError("the point and the direction of a driving force must be finite numbers");
  }
  const double h = 1.0 / model.get_rate_hz();
  int high = 0, low = 0;
  for (int mode = 0; mode < model.get_ringing_mode_count(); ++mode) {
    const double d = model.get_decay_per_s(mode), omega = std::sqrt(model.get_eigenvalue_rad2_s2(mode));
    const double angle = std::sqrt((omega - d) * (omega + d)) * h, shrink = std::exp(-d * h);
    const double a1 = 2.0 * shrink * std::cos(angle), a2 = -shrink * shrink;
    const double gain =
        model.get_gain(mode) * model.calc_projection(mode, triangle, barycentric, direction) * shrink * std::sin(angle) * h / angle;
    if (angle < kLowestFloatRad) {
      add(low_, low, a1, a2, gain);
    } else {
      add(high_, high, a1, a2, gain);
    }
  }
}

void DrivenBank::process(std::span<const float> force_n, std::span<float> pressure_pa) noexcept {
  const FpGuard guard;
  const auto high = static_cast<int>(high_.size()), low = static_cast<int>(low_.size());
  while (!force_n.empty()) {
    const std::size_t count = std::min<std::size_t>(kPeriod, force_n.size());
    const auto samples = static_cast<int>(count);
    float change[kPeriod];
    for (std::size_t n = 0; n < count; ++n) {
      change[n] = force_n[n] - last_force_n_;
      last_force_n_ = force_n[n];
    }
    kernels_->filter(high_.data(), high, change, samples, pressure_pa.data());
    if (low > 0) {
      double wide[kPeriod], sum[kPeriod] = {};
      for (std::size_t n = 0; n < count; ++n) wide[n] = change[n];
      kernels_->filter_double(low_.data(), low, wide, samples, sum);
      for (std::size_t n = 0; n < count; ++n) pressure_pa[n] += static_cast<float>(sum[n]);
    }
    force_n = force_n.subspan(count);
    pressure_pa = pressure_pa.subspan(count);
  }
}

}  // namespace carillon::synth
