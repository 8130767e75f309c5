// Quantities of a finished simulation, computed independently.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "runtime/base/vector.hpp"
#include "runtime/physics/world.hpp"

namespace carillon::physics::tests {

inline Vec3 rotate(const std::array<double, 4>& q, const Vec3& v) {
  const Vec3 u{q[1], q[2], q[3]};
  const Vec3 t = 2.0 * cross(u, v);
  return v + q[0] * t + cross(u, t);
}

/// The pose a part s of the way from a to b; s may lie outside 0..1.
inline Pose blend(const Pose& a, const Pose& b, double s, double time_s) {
  Pose p;
  p.time_s = time_s;
  p.position_m = (1 - s) * a.position_m + s * b.position_m;
  double dot = 0.0, length = 0.0;
  for (int k = 0; k < 4; ++k) dot += a.rotation[k] * b.rotation[k];
  for (int k = 0; k < 4; ++k) {
    p.rotation[k] = (1 - s) * a.rotation[k] + (dot < 0 ? -s : s) * b.rotation[k];
    length += p.rotation[k] * p.rotation[k];
  }
  for (double& c : p.rotation) c /= std::sqrt(length);
  return p;
}

/// The pose at a time, between the recorded ones.
inline Pose pose_at(const std::vector<Pose>& path, double time_s) {
  std::size_t i = 1;
  while (i + 1 < path.size() && path[i].time_s < time_s) ++i;
  if (path.size() < 2) return path.front();
  const Pose &a = path[i - 1], &b = path[i];
  const double s = std::clamp((time_s - a.time_s) / (b.time_s - a.time_s), 0.0, 1.0);
  return blend(a, b, s, time_s);
}

/// The pose at the instant of a touch, from the poses before it alone: at the touch itself the path has a kink.
inline Pose pose_before(const std::vector<Pose>& path, double touch_s) {
  if (path.size() < 3) return path.front();
  std::size_t i = path.size() - 1;
  while (i > 1 && path[i].time_s > touch_s) --i;
  const Pose &a = path[i - 1], &b = path[i];
  const double s = (touch_s - a.time_s) / (b.time_s - a.time_s);
  return blend(a, b, s, touch_s);
}

/// The contact point of a pulse in the frame of the body's mesh.
inline Vec3 point_on_body(const bank::Bank& bank, const Impulse& pulse) {
  const auto& t = bank.triangles.at(pulse.triangle);
  Vec3 x{};
  for (int k = 0; k < 3; ++k) x = x + pulse.barycentric[k] * bank.vertices_m[t[k]];
  return x;
}

inline Vec3 impulse_in_world(const Simulation& s, const Impulse& pulse) {
  const double touch = pulse.time_s - 0.5 * pulse.duration_s;
  return rotate(pose_before(s.poses[pulse.body], touch).rotation, pulse.impulse_n_s);
}

struct EnergySample {
  double time_s, energy_j;
};

/// Kinetic and potential energy of a body between each two poses, by differences of the path alone.
inline std::vector<EnergySample> calc_energies(const bank::Bank& bank, const std::vector<Pose>& path, double g) {
  std::vector<EnergySample> energies;
  for (std::size_t i = 1; i < path.size(); ++i) {
    const Pose &a = path[i - 1], &b = path[i];
    const double dt = b.time_s - a.time_s;
    if (dt < 1e-3) continue;
    const Vec3 ca = a.position_m + rotate(a.rotation, bank.rigid.centre_m), cb = b.position_m + rotate(b.rotation, bank.rigid.centre_m);
    const Vec3 v = (1.0 / dt) * (cb - ca);
    // Spin from the relative rotation conj(a) b, in the frame of the body.
    const auto &p = a.rotation, &q = b.rotation;
    Vec3 w{p[0] * q[1] - p[1] * q[0] - p[2] * q[3] + p[3] * q[2], p[0] * q[2] + p[1] * q[3] - p[2] * q[0] - p[3] * q[1],
           p[0] * q[3] - p[1] * q[2] + p[2] * q[1] - p[3] * q[0]};
    const double s = norm(w);
    if (s > 0.0) w = (2.0 * std::asin(std::min(1.0, s)) / dt / s) * w;
    double spin = 0.0;
    for (int k = 0; k < 3; ++k) {
      for (int l = 0; l < 3; ++l) spin += 0.5 * w[k] * bank.rigid.inertia_kg_m2[3 * k + l] * w[l];
    }
    energies.push_back({0.5 * (a.time_s + b.time_s), 0.5 * bank.rigid.mass_kg * (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]) + spin +
                                                         bank.rigid.mass_kg * g * 0.5 * (ca[2] + cb[2])});
  }
  return energies;
}

}  // namespace carillon::physics::tests
