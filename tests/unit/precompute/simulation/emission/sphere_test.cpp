// Spheres vibrating in Legendre polynomials: far-field error of each radiation formula against a quadrature of the formula
// (docs/equations.md E14); zero for a pulsating sphere.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <complex>
#include <vector>

#include "tests/unit/precompute/simulation/emission/motions.hpp"

namespace carillon::emission {
namespace {

using namespace testing;
using Complex = std::complex<double>;

constexpr double kFreq = 5000.0;

double calc_legendre(int l, double x) {
  const std::array<double, 4> value{1.0, x, 0.5 * (3.0 * x * x - 1.0), 0.5 * (5.0 * x * x * x - 3.0 * x)};
  return value[l];
}

/// Spherical Hankel function of the first kind, order l = 0 to 4, by its recurrence.
Complex calc_hankel(int l, double x) {
  Complex before = std::polar(1.0, x) / x, now = Complex(0.0, -1.0) * before;  // h_{-1}, h_0
  for (int i = 0; i < l; ++i) {
    const Complex next = (2.0 * i + 1.0) / x * now - before;
    before = now;
    now = next;
  }
  return now;
}

/// |p| at distance r on the axis for a radial velocity V P_l.
double calc_exact(int l, double ka, double kr) {
  const Complex slope = l / ka * calc_hankel(l, ka) - calc_hankel(l + 1, ka);
  return kRho * kC * std::abs(calc_hankel(l, kr) / slope);
}

/// Error [dB] of the pressure in the direction where the polynomial is 1.
double find_error(Radiation radiation, int l, double ka) {
  const double k = kTwoPi * kFreq / kC, radius = ka / k, kr = std::max(200.0, 3.0 * ka * ka), r = kr / k;
  const bool is_paper = radiation == Radiation::kPaper2001;
  const double rate = is_paper ? 44100.0 : 48000.0;
  const auto delay = static_cast<std::uint64_t>((r + 2.0 * radius) / kC * rate);
  const Vec3 axis = normalise(Vec3{0.3, 0.5, 0.81});
  Options options = make_options(delay + 500, r * axis, 4);
  options.radiation = radiation;
  options.sample_rate_hz = rate;
  const double speed = 1e-3, omega = kTwoPi * kFreq;
  const auto sound = hear_shape(
      make_part(air::testing::make_ball(16, radius)), options,
      [&](const Vec3& x) {
        const Vec3 radial = normalise(x);
        return calc_legendre(l, dot(radial, axis)) * radial;
      },
      [&](double t) { return speed / omega * std::sin(omega * t); });
  double heard = std::abs(find_amplitude(sound, kFreq, rate, delay + 200, delay + 488));
  if (is_paper) heard *= kFreq / kC;  // the derivative missing in eq. 10: (1 / 2 pi c) d/dt
  return to_db(heard / (speed * calc_exact(l, ka, kr)));
}

constexpr std::array<double, 4> kKa{0.1, 1.0, 5.0, 20.0};

TEST(Sphere, KirchhoffError) {
  const double wanted[4][4] = {{0.0, 2.4, 5.1, 7.1}, {0.0, -0.2, 2.0, 4.1}, {0.0, -0.3, -0.4, 0.3}, {0.0, 0.0, 0.0, -0.1}};
  for (std::size_t i = 0; i < 4; ++i)
    for (int l = 0; l < 4; ++l) {
      const double found = find_error(Radiation::kKirchhoff, l, kKa[i]);
      RecordProperty("ka_" + std::to_string(i) + "_l_" + std::to_string(l), std::to_string(found));
      EXPECT_NEAR(found, wanted[i][l], l == 0 ? 0.1 : 0.3) << "ka " << kKa[i] << ", l " << l;
    }
}

TEST(Sphere, RayleighError) {
  const double wanted[3][4] = {{6.0, 2.5, 1.6, 1.2}, {7.5, 2.6, 1.4, 1.1}, {5.8, -0.4, 2.3, 6.5}};
  for (std::size_t i = 0; i < 3; ++i)
    for (int l = 0; l < 4; ++l)
      EXPECT_NEAR(find_error(Radiation::kRayleigh, l, kKa[i]), wanted[i][l], 0.3) << "ka " << kKa[i] << ", l " << l;
}

TEST(Sphere, Paper2001Error) {
  const double wanted[3][4] = {{-23.5, 22.5, 27.6, 30.7}, {-1.4, 0.6, 6.7, 10.3}, {-0.3, 3.8, 4.6, -6.9}};
  for (std::size_t i = 0; i < 3; ++i)
    for (int l = 0; l < 4; ++l)
      EXPECT_NEAR(find_error(Radiation::kPaper2001, l, kKa[i]), wanted[i][l], 0.3) << "ka " << kKa[i] << ", l " << l;
}

}  // namespace
}  // namespace carillon::emission
