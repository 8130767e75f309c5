// Method: tabulated spectrum of sin^1.5; modal energy as if the pulse were that of rigid bodies.
// Source: Hertz 1882; sin^1.5 after Hunt and Crossley 1975; lambda of Zener 1941 (Phys. Rev. 59, 669): loss 1 - e^2 = 3.4 lambda.
#include "runtime/physics/impact/predict.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace carillon::impact {
namespace {

constexpr int kCells = 512;
constexpr double kEnd = 96.0;

/// At x = kEnd (k/kCells). With t = (1 - cos a)/2 the pulse is smooth at both ends.
std::array<double, kCells + 1> make_table() {
  std::array<double, kCells + 1> table{};
  constexpr int kPoints = 256;
  std::array<double, kPoints> time{}, weight{};
  double area = 0.0;
  for (int i = 0; i < kPoints; ++i) {
    const std::size_t k = i;
    const double angle = std::numbers::pi * (i + 0.5) / kPoints;
    time[k] = 0.5 * (1.0 - std::cos(angle));
    weight[k] = std::pow(std::sin(std::numbers::pi * time[k]), 1.5) * std::sin(angle);
    area += weight[k];
  }
  for (int c = 0; c <= kCells; ++c) {
    const double x = kEnd * c / kCells;
    double sum = 0.0;
    for (std::size_t i = 0; i < kPoints; ++i) sum += weight[i] * std::cos(x * (time[i] - 0.5));  // even about its centre
    table[c] = sum * sum / (area * area);
  }
  return table;
}

struct Share {
  double energy = 0.0, amplitude = 0.0;
};

Share calc_share(const Side& side, double impulse, double length_s) {
  Share share;
  if (!side.modes || side.phi.empty()) return share;
  const auto& omega = side.modes->get_omega();
  for (std::size_t i = 0; i < omega.size(); ++i) {
    const double phi = side.phi[i];
    share.energy += 0.5 * impulse * impulse * phi * phi * calc_pulse_spectrum(omega[i] * length_s);
    if (!side.q.empty())
      share.amplitude += std::abs(phi) * std::sqrt(side.q_dot[i] * side.q_dot[i] + omega[i] * omega[i] * side.q[i] * side.q[i]);
  }
  const std::vector<double> tail = side.modes->calc_tail_shapes(side.modes->calc_tail_compliance(side.phi));
  for (std::size_t j = 0; j < tail.size(); ++j)
    share.energy += 0.5 * impulse * impulse * tail[j] * tail[j] * calc_pulse_spectrum(side.modes->get_tail_omega()[j] * length_s);
  return share;
}

}  // namespace

double calc_pulse_spectrum(double x) {
  static const std::array<double, kCells + 1> table = make_table();
  const double place = x * (kCells / kEnd);
  if (!(place < kCells)) return 0.0;
  const auto k = static_cast<std::size_t>(place);
  const double part = place - static_cast<double>(k);
  return table[k] + part * (table[k + 1] - table[k]);
}

Prediction predict(const Spring& spring, double mass_kg, double speed_m_s, double restitution, const Side& a, const Side& b) {
  Prediction p;
  if (!(speed_m_s > 0.0)) return p;
  p.length_s = calc_elastic_pulse(spring, mass_kg, speed_m_s).length_s;
  const double impulse = 2.0 * mass_kg * speed_m_s, energy = 0.5 * mass_kg * speed_m_s * speed_m_s;
  const Share at_a = calc_share(a, impulse, p.length_s), at_b = calc_share(b, impulse, p.length_s);
  const double modal = at_a.energy + at_b.energy;
  p.is_enough = modal < 0.02 * energy && spring.exponent == 1.5 && at_a.amplitude + at_b.amplitude <= 0.01 * speed_m_s;
  p.restitution = std::min(restitution, std::sqrt(std::max(0.0, 1.0 - modal / energy)));
  p.impulse_n_s = (1.0 + p.restitution) * mass_kg * speed_m_s;
  p.modal_j = modal * (0.25 * (1.0 + p.restitution) * (1.0 + p.restitution));
  return p;
}

}  // namespace carillon::impact
