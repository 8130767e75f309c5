// Method:     p on a rigid sphere in a plane wave is (-i / (ka)^2) sum over m of i^m (2 m + 1) P_m(cos angle) / h_m'(ka), h the spherical
//             Hankel function of the second kind. Ratios h_m / h_(m-1) by stable upward recurrence; 1 / h_m is their product, which
//             underflows to 0 where h_m would overflow. The onset is moved to sample kOnset, the band ends with a cosine from 0.4 to 0.5 of
//             the rate, and the response is the inverse DFT at twice its length, after which a sphere is silent (exp(-c t / a)).
// Source:     Duda and Martens 1998, appendix A; Abramowitz and Stegun 10.1.19, 10.1.21 (recurrences).
// Deviations: plane wave only (distant source).
#include "runtime/acoustics/head/sphere.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <utility>

#include "runtime/acoustics/head/convolve.hpp"
#include "runtime/base/error.hpp"

namespace carillon::head {
namespace {

using Complex = std::complex<double>;
using std::numbers::pi;

constexpr int kSteps = 360;                   // angles: half a degree
constexpr double kLengthS = 128.0 / 48000.0;  // of a response
constexpr double kBandEnd = 0.4;              // of the sample rate
constexpr double kEnough = 1e-14;             // relative size of omitted terms of the series

/// P_m(x) for m < terms.
std::vector<double> calc_legendre(double x, std::size_t terms) {
  std::vector<double> p(std::max<std::size_t>(terms, 2));
  p[0] = 1.0;
  p[1] = x;
  for (std::size_t m = 2; m < terms; ++m) {
    const auto n = static_cast<double>(m);
    p[m] = ((2.0 * n - 1.0) * x * p[m - 1] - (n - 1.0) * p[m - 2]) / n;
  }
  return p;
}

void check(double sample_rate_hz, const Sphere& sphere) {
  if (!(sample_rate_hz >= kMinRateHz && sample_rate_hz <= kMaxRateHz))
    throw InputError(fmt::format("head: a sample rate of {} Hz is outside {} to {} Hz", sample_rate_hz, kMinRateHz, kMaxRateHz));
  if (!(sphere.radius_m >= kMinRadiusM && sphere.radius_m <= kMaxRadiusM))
    throw InputError(fmt::format("head: a radius of {} m is outside {} to {} m", sphere.radius_m, kMinRadiusM, kMaxRadiusM));
  if (!(sphere.ear_azimuth_deg >= 0.0 && sphere.ear_azimuth_deg <= 180.0))
    throw InputError(fmt::format("head: the azimuth of the left ear, {} degrees, is outside 0 to 180", sphere.ear_azimuth_deg));
  if (!(sphere.sound_speed_m_s >= 100.0 && sphere.sound_speed_m_s <= 2000.0))
    throw InputError(fmt::format("head: a speed of sound of {} m/s is outside 100 to 2000 m/s", sphere.sound_speed_m_s));
}

}  // namespace

std::vector<Complex> calc_sphere_coefficients(double ka) {
  const Complex i(0.0, 1.0);
  std::vector<Complex> coefficients;
  Complex ratio = i + 1.0 / ka;                  // h_(m+1) / h_m
  Complex inverse = -i * ka * std::exp(i * ka);  // 1 / h_m
  Complex slope = -ratio;                        // h_m' / h_m
  Complex turn = -i / (ka * ka);                 // times i^m
  for (int m = 0;; ++m) {
    coefficients.push_back((2.0 * m + 1.0) * turn * inverse / slope);
    if (m > ka && std::abs(coefficients.back()) < kEnough) return coefficients;
    inverse /= ratio;
    slope = 1.0 / ratio - (m + 2.0) / ka;
    ratio = (2.0 * m + 3.0) / ka - 1.0 / ratio;
    turn *= i;
  }
}

double calc_sphere_mean_power(double ka) {
  double sum = 0.0;
  const std::vector<Complex> coefficients = calc_sphere_coefficients(ka);
  for (std::size_t m = 0; m < coefficients.size(); ++m) sum += std::norm(coefficients[m]) / (2.0 * static_cast<double>(m) + 1.0);
  return sum;
}

double calc_sphere_onset_s(const Sphere& sphere, double angle_rad) {
  const double travel = angle_rad <= pi / 2 ? -std::cos(angle_rad) : angle_rad - pi / 2;
  return travel * sphere.radius_m / sphere.sound_speed_m_s;
}

std::shared_ptr<const Head> make_sphere(double sample_rate_hz, const Sphere& sphere) {
  check(sample_rate_hz, sphere);
  const auto taps = static_cast<std::size_t>(kTapUnit * std::ceil(kLengthS * sample_rate_hz / kTapUnit));
  const std::size_t period = 2 * taps;             // of the DFT
  std::vector<std::vector<Complex>> series(taps);  // by frequency k rate / period, k = 1 on
  std::size_t terms = 0;
  for (std::size_t k = 1; k < taps; ++k) {
    const double omega = 2.0 * pi * static_cast<double>(k) * sample_rate_hz / static_cast<double>(period);
    series[k] = calc_sphere_coefficients(omega * sphere.radius_m / sphere.sound_speed_m_s);
    terms = std::max(terms, series[k].size());
  }
  std::vector<Complex> circle(period);
  for (std::size_t n = 0; n < period; ++n) circle[n] = std::polar(1.0, 2.0 * pi * static_cast<double>(n) / static_cast<double>(period));

  const int origin = static_cast<int>(std::ceil(sphere.radius_m / sphere.sound_speed_m_s * sample_rate_hz));
  const double azimuth = sphere.ear_azimuth_deg * pi / 180.0;
  Head::Content head{
      .sample_rate_hz = sample_rate_hz,
      .taps = static_cast<int>(taps),
      .origin_samples = origin,
      .responses = std::vector<float>((kSteps + 1) * taps),
      .delays = std::vector<double>(kSteps + 1),
      .lookup = ByAngle{{Vec3{std::cos(azimuth), std::sin(azimuth), 0.0}, Vec3{std::cos(azimuth), -std::sin(azimuth), 0.0}}, kSteps}};
  std::vector<Complex> spectrum(taps);
  for (std::size_t step = 0; step <= kSteps; ++step) {
    const double angle = pi * static_cast<double>(step) / kSteps;
    const double onset = calc_sphere_onset_s(sphere, angle) * sample_rate_hz;
    head.delays[step] = onset + origin;
    const std::vector<double> legendre = calc_legendre(std::cos(angle), terms);
    for (std::size_t k = 1; k < taps; ++k) {
      Complex p = 0.0;
      for (std::size_t m = 0; m < series[k].size(); ++m) p += series[k][m] * legendre[m];
      const double along = static_cast<double>(k) / static_cast<double>(period);  // of the sample rate
      const double fade = along < kBandEnd ? 1.0 : 0.5 + 0.5 * std::cos(pi * (along - kBandEnd) / (0.5 - kBandEnd));
      spectrum[k] = 2.0 * fade * p * std::polar(1.0, 2.0 * pi * along * (onset - kOnset));
    }
    for (std::size_t n = 0; n < taps; ++n) {
      double sum = 1.0;  // frequency 0
      for (std::size_t k = 1; k < taps; ++k) {
        const Complex& turn = circle[k * n % period];
        sum += spectrum[k].real() * turn.real() - spectrum[k].imag() * turn.imag();
      }
      head.responses[step * taps + n] = static_cast<float>(sum / static_cast<double>(period));
    }
  }
  return std::make_shared<const Head>(std::move(head));
}

}  // namespace carillon::head
