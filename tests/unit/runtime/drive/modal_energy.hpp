// Energy of modes after the events of a Rig.
#pragma once

#include <cmath>
#include <complex>
#include <utility>
#include <vector>

#include "tests/unit/runtime/drive/touch_rig.hpp"

namespace carillon::drive::tests {

/// Energy of undamped modes after the events on a body [J]. Pulses sin^1.5 by quadrature.
inline double calc_modal_j(const Rig& rig, const bank::Bank& bank, int body) {
  std::vector<std::complex<double>> state(bank.mode_count());
  const auto push = [&](std::int32_t triangle, const Vec3& barycentric, const Vec3& impulse, double begin_s, double length_s) {
    const std::vector<double> phi = bank::calc_shapes(bank, triangle, barycentric);
    for (std::size_t i = 0; i < state.size(); ++i) {
      const double omega = std::sqrt(bank.eigenvalue_rad2_s2[i]), x = 0.5 * omega * length_s;
      const double given = phi[3 * i] * impulse[0] + phi[3 * i + 1] * impulse[1] + phi[3 * i + 2] * impulse[2];
      state[i] += given * (x > 0.0 ? std::sin(x) / x : 1.0) * std::polar(1.0, omega * (begin_s + 0.5 * length_s));
    }
  };
  for (const auto& f : rig.list<events::Force>()) {
    if (f.body != body) continue;
    for (int k = 0; k < f.count; ++k) {
      const Vec3 impulse{f.impulse_n_s[k][0], f.impulse_n_s[k][1], f.impulse_n_s[k][2]};
      push(f.triangle, f.barycentric, impulse, f.time_s + k * f.step_s, f.step_s);
    }
  }
  for (const auto& p : rig.list<events::Impulse>()) {
    if (p.body != body) continue;
    constexpr int kParts = 200;
    double area = 0.0;
    for (int k = 0; k < kParts; ++k) area += std::pow(std::sin(M_PI * (k + 0.5) / kParts), 1.5);
    for (int k = 0; k < kParts; ++k)
      push(p.triangle, p.barycentric, (std::pow(std::sin(M_PI * (k + 0.5) / kParts), 1.5) / area) * p.impulse_n_s,
           p.time_s + (static_cast<double>(k) / kParts - 0.5) * p.duration_s, p.duration_s / kParts);
  }
  double sum = 0.0;
  for (const auto& x : state) sum += 0.5 * std::norm(x);
  return sum;
}

/// Blow of a plate on the ground at a quarter of its edges, at 1 m/s: the plate turns, and the impulse is that of a rigid body. Returns the
/// energy of the blow [J] and its impulse [N s].
inline std::pair<double, double> strike_plate(Rig& rig, const bank::Bank& plate, double thickness_m, double restitution) {
  rig.add(plate, "plate", {0, 0, 0.5 * thickness_m}, {0, 0, -1.0}, restitution);
  rig.start();
  const Vec3 where{0.05, 0.08, 0.0};
  const auto& inertia = plate.rigid.inertia_kg_m2;
  const double inverse = 1.0 / plate.rigid.mass_kg + where[1] * where[1] / inertia[0] + where[0] * where[0] / inertia[4];
  const double impulse = (1.0 + restitution) / inverse;
  rig.poses[0].velocity_m_s[2] += impulse / plate.rigid.mass_kg;
  rig.poses[0].spin_rad_s = {where[1] * impulse / inertia[0], -where[0] * impulse / inertia[4], 0.0};
  rig.step(1e-4, {on_ground(0, where, impulse)});
  return {0.5 / inverse, impulse};
}

}  // namespace carillon::drive::tests
