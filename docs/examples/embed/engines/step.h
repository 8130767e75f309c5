// Poses and contact points of a step of any engine for carillon_touches; used by jolt.h, physx.h and box3d.h. C++17.
#ifndef CARILLON_STEP_H
#define CARILLON_STEP_H

#include <carillon.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace carillon {

class Step {
 public:
  using Vector = std::array<double, 3>;

  explicit Step(carillon_touches* touches) : touches_(touches) {}

  /// Room for the body `index` of carillon_touches_add.
  void make_room(std::int32_t index) {
    if (poses_.size() <= static_cast<std::size_t>(index)) poses_.resize(static_cast<std::size_t>(index) + 1, make_pose());
  }
  /// Pose of an added body. rotation: w x y z of the mesh axes; spin [rad/s] in world axes.
  void set_pose(std::int32_t index, const Vector& centre, const std::array<double, 4>& rotation, const Vector& velocity, const Vector& spin,
                std::uint32_t flags) {
    carillon_pose& pose = poses_[static_cast<std::size_t>(index)];
    for (std::size_t k = 0; k < 3; ++k) {
      pose.position_m[k] = centre[k];
      pose.velocity_m_s[k] = velocity[k];
      pose.spin_rad_s[k] = spin[k];
    }
    for (std::size_t k = 0; k < 4; ++k) pose.rotation[k] = rotation[k];
    pose.flags = flags;
  }
  Vector get_centre(std::int32_t index) const {
    const double* at = poses_[static_cast<std::size_t>(index)].position_m;
    return {at[0], at[1], at[2]};
  }

  /// A contact of bodies a and b; one of them may be the ground (-1). on_b: on the surface of b, in the world [m]; normal: unit, from b to
  /// a; gap [m]; impulse: on a along the normal [N s], NAN: found from the velocities.
  void add(std::int32_t a, std::int32_t b, const Vector& on_b, const Vector& normal, double gap, double impulse) {
    if (a == b) return;
    const bool is_turned = a < 0;
    carillon_point point = carillon_point();
    point.a = is_turned ? b : a;
    point.b = is_turned ? -1 : b;
    for (std::size_t k = 0; k < 3; ++k) {
      point.point_m[k] = on_b[k] + (is_turned ? gap * normal[k] : 0.0);
      point.normal[k] = is_turned ? -normal[k] : normal[k];
      point.friction_n_s[k] = NAN;
    }
    point.gap_m = gap;
    point.impulse_n_s = impulse;
    point.curvature_per_m = NAN;  // of the surfaces of the banks
    points_.push_back(point);
  }

  /// Call carillon_touches_start and carillon_touches_step; the latter consumes the points.
  carillon_status start(double time_s, char* message, std::size_t size) {
    points_.clear();
    return carillon_touches_start(touches_, time_s, poses_.data(), static_cast<std::int32_t>(poses_.size()), message, size);
  }
  carillon_status finish(double time_s, char* message, std::size_t size) {
    const carillon_status status = carillon_touches_step(touches_, time_s, poses_.data(), static_cast<std::int32_t>(poses_.size()),
                                                         points_.data(), static_cast<std::int32_t>(points_.size()), message, size);
    points_.clear();
    return status;
  }

 private:
  static carillon_pose make_pose() {
    carillon_pose pose = carillon_pose();
    pose.rotation[0] = 1.0;
    return pose;
  }

  carillon_touches* touches_;
  std::vector<carillon_pose> poses_;
  std::vector<carillon_point> points_;
};

}  // namespace carillon

#endif  // CARILLON_STEP_H
