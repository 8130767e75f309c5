// The contact pulse: force over time of one elastic collision, of unit area, and its moments over a sample.
#pragma once

#include <array>

namespace carillon::synth {

/// Number of Chebyshev moments by which a pulse reaches the modes: enough for -190 dB at the Nyquist frequency.
inline constexpr int kMoments = 12;
using Moments = std::array<double, kMoments>;

/// The pulse at `x` = time since its start / its duration: sin(pi x)^1.5 for 0 <= x <= 1, zero outside, scaled so that its integral over x
/// is 1. Hertz's contact force is close to this shape (Hunt & Crossley 1975). Pure; any thread.
double calc_pulse(double x) noexcept;

/// Moments of the pulse over one interval of time: moment j = integral of T_j(2 u - 1) f(u) du over 0 <= u <= 1, where u runs over the
/// interval and T_j is the Chebyshev polynomial. `start` and `duration` place the pulse in the same unit (one interval = 1); f integrates
/// to 1 over the pulse. A duration below 1e-9 is an impulse at `start`, counted in the interval 0 < u <= 1. No heap, no throw; any thread.
Moments calc_pulse_moments(double start, double duration) noexcept;

/// T_j(2 u - 1) for all j.
Moments calc_chebyshev(double u) noexcept;

/// Coefficients of the polynomial sum_j a_j T_j(2 u - 1) through `values` at the Chebyshev points u_k = (1 + cos(pi (k + 1/2) / kMoments))
/// / 2.
Moments calc_chebyshev_coefficients(const std::array<double, kMoments>& values) noexcept;
std::array<double, kMoments> get_chebyshev_points() noexcept;

}  // namespace carillon::synth
