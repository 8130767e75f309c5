#include "runtime/scene/pose.hpp"

#include <algorithm>
#include <cmath>

namespace carillon::scene {

Vec3 calc_world_point(const physics::Pose& pose, const Vec3& x) {
  const auto [w, a, b, c] = pose.rotation;
  // x + 2 w (v cross x) + 2 v cross (v cross x), v = (a, b, c).
  const Vec3 t{2.0 * (b * x[2] - c * x[1]), 2.0 * (c * x[0] - a * x[2]), 2.0 * (a * x[1] - b * x[0])};
  return {pose.position_m[0] + x[0] + w * t[0] + b * t[2] - c * t[1], pose.position_m[1] + x[1] + w * t[1] + c * t[0] - a * t[2],
          pose.position_m[2] + x[2] + w * t[2] + a * t[1] - b * t[0]};
}

physics::Pose find_pose(std::span<const physics::Pose> poses, double time_s) {
  const auto after =
      std::upper_bound(poses.begin(), poses.end(), time_s, [](double t, const physics::Pose& pose) { return t < pose.time_s; });
  if (after == poses.begin()) return poses.front();
  if (after == poses.end()) return poses.back();
  const physics::Pose& a = *(after - 1);
  const physics::Pose& b = *after;
  const double u = (time_s - a.time_s) / (b.time_s - a.time_s);
  physics::Pose pose;
  pose.time_s = time_s;
  double dot = 0.0;
  for (int k = 0; k < 3; ++k) pose.position_m[k] = (1.0 - u) * a.position_m[k] + u * b.position_m[k];
  for (int k = 0; k < 4; ++k) dot += a.rotation[k] * b.rotation[k];
  double norm = 0.0;
  for (int k = 0; k < 4; ++k) {
    pose.rotation[k] = (1.0 - u) * a.rotation[k] + (dot < 0.0 ? -u : u) * b.rotation[k];
    norm += pose.rotation[k] * pose.rotation[k];
  }
  for (double& x : pose.rotation) x /= std::sqrt(norm);
  return pose;
}

}  // namespace carillon::scene
