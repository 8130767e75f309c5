// Rigid sphere with two ears.
#pragma once

#include <complex>
#include <memory>
#include <vector>

#include "runtime/acoustics/head/head.hpp"

namespace carillon::head {

inline constexpr double kMinRadiusM = 0.03, kMaxRadiusM = 0.3;

/// Duda and Martens 1998: radius of an average head, ears behind its middle.
struct Sphere {
  double radius_m = 0.0875;
  double ear_azimuth_deg = 100.0;  // of the left ear, from straight ahead to the left; the right ear mirrors it
  double sound_speed_m_s = 343.0;  // bank::kSoundSpeedMs
};

/// Responses to a plane wave (a source farther than 1 m). Near sources are treated as distant: the louder near ear of a source at 0.25 m (6
/// dB at low frequencies) is left out. 361 angles, interpolated linearly. 0 dB at low frequencies; exact to 0.4 of the sample rate, then
/// the band ends. Throws InputError for a sample rate outside kMinRateHz to kMaxRateHz, a radius outside kMinRadiusM to kMaxRadiusM and
/// other impossible parameters. Takes milliseconds; not for an audio thread.
std::shared_ptr<const Head> make_sphere(double sample_rate_hz, const Sphere& sphere = {});

/// Coefficients c_m of the pressure on a rigid sphere in a plane wave, relative to the pressure at its centre without the sphere: p = sum
/// of c_m P_m(cos angle), angle between source and surface point, time exp(+i omega t). ka > 0: circumference over wavelength. Duda and
/// Martens 1998, eq. (A1) for a source at infinity; they use exp(-i omega t).
std::vector<std::complex<double>> calc_sphere_coefficients(double ka);

/// Mean of |p|^2 over all directions.
double calc_sphere_mean_power(double ka);

/// Delay of the first arrival at a point of the sphere relative to its centre [s]: straight or around (Woodworth and Schlosberg 1954).
/// Negative on the near side.
double calc_sphere_onset_s(const Sphere& sphere, double angle_rad);

}  // namespace carillon::head
