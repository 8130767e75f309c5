// Method: fourth-order Runge-Kutta on the quaternion at constant angular momentum.
// Source: E. Hairer, G. Wanner, "Solving ordinary differential equations I" (1993), II.1.
#include "runtime/physics/rigid/body.hpp"

#include <algorithm>

namespace carillon::rigid {

Placed place(const Solid& solid, const State& state) {
  Placed p;
  p.rotation = make_rotation(state.rotation);
  const Mat3 back = transpose(p.rotation);
  if (!solid.fixed) {
    p.inverse_inertia = p.rotation * (solid.inverse_inertia * back);
    p.spin = p.inverse_inertia * state.momentum;
  }
  p.frame = {p.rotation, state.centre - p.rotation * solid.centre_m};
  return p;
}

State fly(const Solid& solid, const State& from, const Vec3& gravity, double time_s) {
  State to = from;
  to.centre = from.centre + time_s * from.velocity + (0.5 * time_s * time_s) * gravity;
  to.velocity = from.velocity + time_s * gravity;
  if (from.momentum == Vec3{}) return to;
  const auto calc_spin = [&](const Quaternion& q) {
    const Mat3 rotation = make_rotation(q);
    return rotation * (solid.inverse_inertia * (transpose(rotation) * from.momentum));
  };
  const auto calc_rate = [&](const Quaternion& q) {
    const Vec3 w = calc_spin(q);
    const Quaternion rate = multiply({0, w[0], w[1], w[2]}, q);
    return Quaternion{0.5 * rate[0], 0.5 * rate[1], 0.5 * rate[2], 0.5 * rate[3]};
  };
  const auto add = [](const Quaternion& q, double s, const Quaternion& k) {
    return Quaternion{q[0] + s * k[0], q[1] + s * k[1], q[2] + s * k[2], q[3] + s * k[3]};
  };
  constexpr double kSubstepTurnRad = 0.05;  // rad
  const int parts = std::max(1, static_cast<int>(std::ceil(std::min(norm(calc_spin(from.rotation)) * time_s / kSubstepTurnRad, 1e6))));
  const double h = time_s / parts;
  Quaternion q = from.rotation;
  for (int part = 0; part < parts; ++part) {
    const Quaternion k1 = calc_rate(q), k2 = calc_rate(add(q, 0.5 * h, k1)), k3 = calc_rate(add(q, 0.5 * h, k2)),
                     k4 = calc_rate(add(q, h, k3));
    for (std::size_t c = 0; c < 4; ++c) q[c] += h / 6.0 * (k1[c] + 2.0 * k2[c] + 2.0 * k3[c] + k4[c]);
    q = normalise(q);
  }
  to.rotation = q;
  return to;
}

double calc_kinetic(const Solid& solid, const State& state, const Placed& placed) {
  return solid.fixed ? 0.0 : 0.5 * (solid.mass_kg * dot(state.velocity, state.velocity) + dot(placed.spin, state.momentum));
}

double calc_kinetic(const Solid& solid, const State& state) { return calc_kinetic(solid, state, place(solid, state)); }

double calc_energy(const Solid& solid, const State& state, const Vec3& gravity) {
  return solid.fixed ? 0.0 : calc_kinetic(solid, state) - solid.mass_kg * dot(gravity, state.centre);
}

}  // namespace carillon::rigid
