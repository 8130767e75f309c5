// The head without a file: a rigid sphere with two ears.
#pragma once

#include <complex>
#include <memory>
#include <vector>

#include "runtime/acoustics/head/head.hpp"

namespace carillon::head {

inline constexpr double kMinRadiusM = 0.03, kMaxRadiusM = 0.3;

/// Duda and Martens 1998: the radius is that of an average head, and ears lie behind its middle.
struct Sphere {
  double radius_m = 0.0875;
  double ear_azimuth_deg = 100.0;  // of the left ear, from straight ahead to the left; the right one mirrors it
  double sound_speed_m_s = 343.0;  // bank::kSoundSpeedMs
};

/// Responses to a plane wave: a source farther than 1 m. What is nearer is heard as if it were far: the louder near ear of a source at
/// 0.25 m (by 6 dB at low frequencies) is left out. 361 angles, linear between them. Low frequencies have 0 dB everywhere; exact to 0.4 of
/// the sample rate, then the band ends. Throws InputError for a sample rate outside kMinRateHz to kMaxRateHz, a radius outside
/// kMinRadiusM to kMaxRadiusM and what else cannot be. Takes some milliseconds; not for an audio thread.
std::shared_ptr<const Head> make_sphere(double sample_rate_hz, const Sphere& sphere = {});

/// The coefficients c of the pressure on a rigid sphere in a plane wave, over that at its centre without it: p = sum over m of
/// c_m P_m(cos angle), angle: between the direction of the source and that of the place, time as exp(+i omega t). ka: circumference over
/// wave length, above 0. Duda and Martens 1998, eq. (A1) for a source at infinity; they write the time as exp(-i omega t).
std::vector<std::complex<double>> calc_sphere_coefficients(double ka);

/// |p|^2, the mean over all directions.
double calc_sphere_mean_power(double ka);

/// How much later [s] the first sound arrives at a place on the sphere than at its centre: straight or around (Woodworth and Schlosberg
/// 1954). Negative on the near side.
double calc_sphere_onset_s(const Sphere& sphere, double angle_rad);

}  // namespace carillon::head
