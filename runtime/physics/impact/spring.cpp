// Method: discrete gradient of the spring's potential (Gonzalez 1996), so that the work of a step is a difference of potentials. For p =
// 1.5 with a = sqrt(y0), b = sqrt(y1) it is 2/5 K (b^5 - a^5)/(b^2 - a^2) = 2/5 K (a^4 + a^3 b + a^2 b^2 + a b^3 + b^4)/(a + b).
// Source: Hertz 1882; Hunt and Crossley 1975 (J. Appl. Mech. 42, 440).
#include "runtime/physics/impact/spring.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace carillon::impact {
namespace {

double calc_power(double y, double p) { return p == 1.5 ? y * std::sqrt(y) : std::pow(y, p); }

/// Mean of y^p over y0 .. y1; 0 for y < 0.
double calc_mean_power(double y0, double y1, double p) {
  const double low = std::min(y0, y1), high = std::max(y0, y1);
  if (!(high > 0.0)) return 0.0;
  if (low <= 0.0) return high * calc_power(high, p) / ((p + 1.0) * (high - low));
  if (p == 1.5) {
    const double a = std::sqrt(low), b = std::sqrt(high), ab = a * b;
    return 0.4 * (low * low + high * high + ab * (low + high + ab)) / (a + b);
  }
  if (high - low > 0.02 * high) return (high * std::pow(high, p) - low * std::pow(low, p)) / ((p + 1.0) * (high - low));
  const double middle = 0.5 * (low + high), off = 0.5 * (high - low) * std::sqrt(0.6);  // 3-point Gauss quadrature
  return (5.0 * std::pow(middle - off, p) + 8.0 * std::pow(middle, p) + 5.0 * std::pow(middle + off, p)) / 18.0;
}

}  // namespace

double calc_contact_compliance(double young_a_pa, double poisson_a, double young_b_pa, double poisson_b) {
  return (1.0 - poisson_a * poisson_a) / young_a_pa + (1.0 - poisson_b * poisson_b) / young_b_pa;
}

double calc_patch_radius(double force_n, double radius_m, double compliance_per_pa) {
  return std::cbrt(0.75 * force_n * radius_m * compliance_per_pa);
}

double calc_hertz_stiffness(double young_a_pa, double poisson_a, double young_b_pa, double poisson_b, double radius_m) {
  return calc_hertz_stiffness(calc_contact_compliance(young_a_pa, poisson_a, young_b_pa, poisson_b), radius_m);
}

double calc_hertz_stiffness(double compliance_per_pa, double radius_m) { return 4.0 / 3.0 / compliance_per_pa * std::sqrt(radius_m); }

double calc_face_stiffness(double compliance_per_pa, double area_m2) {
  return 2.0 / compliance_per_pa * std::sqrt(area_m2 / std::numbers::pi);
}

double calc_spring_energy(const Spring& spring, double y) {
  return y > 0.0 ? spring.stiffness * y * calc_power(y, spring.exponent) / (spring.exponent + 1.0) : 0.0;
}

double calc_compression(const Spring& spring, double energy_j) {
  const double p = spring.exponent + 1.0;
  return std::pow(p * energy_j / spring.stiffness, 1.0 / p);
}

StepForce calc_step_force(const Spring& spring, double y0, double y1, double h_s) {
  const double p = spring.exponent, k = spring.stiffness, dy = y1 - y0, largest = std::max(y0, y1);
  if (!(largest > 0.0)) return {};
  const double mean = k * calc_mean_power(y0, y1, p);
  const double slope =
      std::abs(dy) > 1e-6 * largest ? ((y1 > 0.0 ? k * calc_power(y1, p) : 0.0) - mean) / dy : 0.5 * p * k * std::pow(largest, p - 1.0);
  if (spring.hysteresis_s_m == 0.0) return {mean, slope};
  const double factor = 1.0 + spring.hysteresis_s_m * dy / h_s;
  if (!(factor > 0.0)) return {};
  return {mean * factor, slope * factor + mean * spring.hysteresis_s_m / h_s};
}

double calc_hysteresis(double restitution, double speed_m_s) {
  if (restitution >= 1.0) return 0.0;
  const double e = std::max(restitution, 0.002);
  // f(x) = x - ln(1 + x) + ln(1 - e x) + e x is positive below the root and falls to -infinity at x = 1/e.
  const auto f = [e](double x) { return x - std::log1p(x) + std::log1p(-e * x) + e * x; };
  double low = 0.0, high = 1.0 / e;
  if (e > 0.999) return 1.5 * (1.0 - e) / speed_m_s;  // f is below rounding there; e = 1 - 2/3 x
  for (int i = 0; i < 200 && high - low > 1e-16 * high; ++i) {
    const double middle = 0.5 * (low + high);
    (f(middle) > 0.0 ? low : high) = middle;
  }
  return 0.5 * (low + high) / speed_m_s;
}

ElasticPulse calc_elastic_pulse(const Spring& spring, double mass_kg, double speed_m_s) {
  const double p = spring.exponent, n = 1.0 / (p + 1.0);
  const double y = std::pow(0.5 * (p + 1.0) * mass_kg * speed_m_s * speed_m_s / spring.stiffness, n);
  return {y, 2.0 * y / speed_m_s * std::sqrt(std::numbers::pi) * std::tgamma(1.0 + n) / std::tgamma(0.5 + n)};
}

double calc_hertz_duration(double compliance, double radius, double mass, double speed) {
  constexpr double kMinSpeedMS = 1e-3, kMinS = 5e-6, kMaxS = 20e-3;
  const double duration = 2.87 * std::pow(mass * mass * compliance * compliance / (radius * std::max(speed, kMinSpeedMS)), 0.2);
  return std::clamp(duration, kMinS, kMaxS);
}

}  // namespace carillon::impact
