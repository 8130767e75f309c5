// Method: the impulse of a spring and a damper at the end of the step, implicit Euler, with the 3 x 3 mobility of the held point.
// Source: D. Baraff, A. Witkin, "Large steps in cloth simulation" (1998): implicit springs.
#include "runtime/physics/rigid/grab.hpp"

#include <algorithm>

namespace carillon::rigid {

joints::Spatial calc_grab_impulse(const Bodies& bodies, const Grab& grab, double h) {
  const int body = grab.body;
  const State& state = bodies.state(body);
  const Placed& placed = bodies.placed(body);
  const Vec3 arm = placed.rotation * grab.at;
  const Articulation* articulation = bodies.find_articulation(body);
  impact::Mobility own{};
  if (articulation != nullptr) own = bodies.calc_own_mobility(*articulation, bodies.get_member(body));
  const auto calc_response = [&](const Vec3& impulse) {  // velocity of the point per impulse on it
    const Vec3 couple = cross(arm, impulse);
    if (articulation == nullptr) return (1.0 / bodies.solid(body).mass_kg) * impulse + cross(placed.inverse_inertia * couple, arm);
    Vec3 velocity{}, spin{};
    for (std::size_t r = 0; r < 3; ++r)
      for (std::size_t c = 0; c < 3; ++c) {
        velocity[r] += own[r][c] * impulse[c] + own[r][c + 3] * couple[c];
        spin[r] += own[r + 3][c] * impulse[c] + own[r + 3][c + 3] * couple[c];
      }
    return velocity + cross(spin, arm);
  };
  const double end_s = bodies.get_time() + h, softness = 0.5 * grab.stiffness_n_m * h * h + grab.damping_n_s_m * h;
  Mat3 system{};
  for (std::size_t c = 0; c < 3; ++c) {
    Vec3 unit{};
    unit[c] = 1.0;
    const Vec3 response = calc_response(unit);
    for (std::size_t r = 0; r < 3; ++r) system[r][c] = (r == c ? 1.0 : 0.0) + softness * response[r];
  }
  const Vec3 now = state.velocity + cross(placed.spin, arm), free = now + h * bodies.gravity();
  const Vec3 left = grab.find_target(end_s) - (state.centre + arm) - (0.5 * h) * (now + free);
  Vec3 impulse = calc_inverse(system) * (h * (grab.stiffness_n_m * left + grab.damping_n_s_m * (grab.find_velocity(end_s) - free)));
  if (const double size = norm(impulse); size > h * grab.max_force_n) impulse = (h * grab.max_force_n / size) * impulse;
  return {impulse, cross(arm, impulse)};
}

double calc_pull(const Solid& solid, double force_n) {
  double inverse = 0.0;
  for (std::size_t k = 0; k < 3; ++k) inverse += solid.inverse_inertia[k][k];  // the trace bounds the largest principal value
  return force_n * (1.0 / solid.mass_kg + solid.radius_m * solid.radius_m * inverse);
}

}  // namespace carillon::rigid
