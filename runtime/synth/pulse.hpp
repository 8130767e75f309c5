// Contact pulse: force over time of one elastic collision, of unit area, and its moments over a sample.
#pragma once

#include <array>

#include "runtime/events/events.hpp"

namespace carillon::synth {

/// Chebyshev moments of a pulse: -190 dB at the Nyquist frequency.
inline constexpr int kMoments = 12;
using Moments = std::array<double, kMoments>;

using events::PulseShape;

/// Length of the non-zero force of a contact of this duration, in the same unit. kHertz: the duration. kGaussian: 1.57 durations, with the
/// same centre: eight standard deviations of the Gaussian with the variance of the Hertz pulse. Pure; any thread.
double calc_pulse_length(PulseShape shape, double duration) noexcept;

/// Force at `x` = time since its begin / its length, zero outside 0 <= x <= 1, with integral 1 over x. kHertz: sin(pi x)^1.5, close to
/// Hertz's contact force (Hunt & Crossley 1975). kGaussian: exp(-(8 (x - 1/2))^2 / 2) (O'Brien, Shen and Gatchalian 2002). Pure; any
/// thread.
double calc_pulse(PulseShape shape, double x) noexcept;

/// Moments of the pulse over one interval: moment j = integral of T_j(2 u - 1) f(u) du over 0 <= u <= 1, T_j the Chebyshev polynomial.
/// `start` and `length` (calc_pulse_length()) in units of the interval; f integrates to 1 over the pulse. A length below 1e-9 is an impulse
/// at `start`, within the interval 0 < u <= 1. No heap, no throw; any thread.
Moments calc_pulse_moments(PulseShape shape, double start, double length) noexcept;

/// Constant force from `start` to `start + length`, in closed form; accurate to 1e-10 for lengths of at least kShortestStep.
inline constexpr double kShortestStep = 1e-6;
Moments calc_level_moments(double start, double length) noexcept;

/// T_j(2 u - 1) for all j.
Moments calc_chebyshev(double u) noexcept;

/// Coefficients of the polynomial sum_j a_j T_j(2 u - 1) through `values` at the Chebyshev points u_k = (1 + cos(pi (k + 1/2) / kMoments))
/// / 2.
Moments calc_chebyshev_coefficients(const std::array<double, kMoments>& values) noexcept;
std::array<double, kMoments> get_chebyshev_points() noexcept;

}  // namespace carillon::synth
