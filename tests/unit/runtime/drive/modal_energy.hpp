// Energy of modes after the events of a Rig.
#pragma once

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>
#include <utility>
#include <vector>

#include "tests/unit/runtime/drive/touch_rig.hpp"

namespace carillon::drive::tests {

/// Energy of the undamped modes of a body over time [s, J], after each piece of the events on it. Pulses sin^1.5 by quadrature.
inline std::vector<std::pair<double, double>> list_modal_j(const Rig& rig, const bank::Bank& bank, int body) {
  /// A part of a force: its middle, length and impulse.
  struct Piece {
    double time_s = 0.0, length_s = 0.0;
    Vec3 impulse{};
    std::size_t place = 0;
  };
  std::vector<Piece> pieces;
  std::vector<std::vector<double>> shapes;
  for (const auto& f : rig.list<events::Force>()) {
    if (f.body != body) continue;
    shapes.push_back(bank::calc_shapes(bank, f.triangle, f.barycentric));
    for (int k = 0; k < f.count; ++k) {
      const Vec3 impulse{f.impulse_n_s[k][0], f.impulse_n_s[k][1], f.impulse_n_s[k][2]};
      pieces.push_back({f.time_s + (k + 0.5) * f.step_s, f.step_s, impulse, shapes.size() - 1});
    }
  }
  for (const auto& p : rig.list<events::Impulse>()) {
    if (p.body != body) continue;
    shapes.push_back(bank::calc_shapes(bank, p.triangle, p.barycentric));
    constexpr int kParts = 200;
    double area = 0.0;
    for (int k = 0; k < kParts; ++k) area += std::pow(std::sin(M_PI * (k + 0.5) / kParts), 1.5);
    for (int k = 0; k < kParts; ++k) {
      const Vec3 impulse = (std::pow(std::sin(M_PI * (k + 0.5) / kParts), 1.5) / area) * p.impulse_n_s;
      pieces.push_back({p.time_s + ((k + 0.5) / kParts - 0.5) * p.duration_s, p.duration_s / kParts, impulse, shapes.size() - 1});
    }
  }
  std::stable_sort(pieces.begin(), pieces.end(), [](const Piece& x, const Piece& y) { return x.time_s < y.time_s; });
  std::vector<std::complex<double>> state(bank.mode_count());
  std::vector<std::pair<double, double>> course;
  for (const Piece& piece : pieces) {
    const std::vector<double>& phi = shapes[piece.place];
    double sum = 0.0;
    for (std::size_t i = 0; i < state.size(); ++i) {
      const double omega = std::sqrt(bank.eigenvalue_rad2_s2[i]), x = 0.5 * omega * piece.length_s;
      const double given = phi[3 * i] * piece.impulse[0] + phi[3 * i + 1] * piece.impulse[1] + phi[3 * i + 2] * piece.impulse[2];
      state[i] += given * (x > 0.0 ? std::sin(x) / x : 1.0) * std::polar(1.0, omega * piece.time_s);
      sum += 0.5 * std::norm(state[i]);
    }
    course.emplace_back(piece.time_s + 0.5 * piece.length_s, sum);
  }
  return course;
}

/// Energy of the undamped modes after the events on a body [J].
inline double calc_modal_j(const Rig& rig, const bank::Bank& bank, int body) {
  const auto course = list_modal_j(rig, bank, body);
  return course.empty() ? 0.0 : course.back().second;
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
