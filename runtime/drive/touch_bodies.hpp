// Bodies and points of a Touches, prepared for a step. Internal to this folder.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <vector>

#include "runtime/base/vector.hpp"
#include "runtime/drive/scene.hpp"
#include "runtime/drive/sharp_edges.hpp"
#include "runtime/drive/touches.hpp"
#include "runtime/physics/impact/modes.hpp"

namespace carillon::drive {

/// A body of a Touches: its description, surface and modes.
struct TouchBody {
  TouchesBody given;
  bool is_used = false;                          // false: removed
  bool is_new = true;                            // no step since it was added: its motion before is unknown
  std::shared_ptr<const geometry::Shape> shape;  // null: silent, without bank
  std::shared_ptr<const SharpEdges> edges;
  std::shared_ptr<const impact::Modes> modes;  // null: none
  Mat3 inertia{}, inverse_inertia{};           // mesh axes
  TouchesPose pose;                            // of the last step
};

/// A contact point with its positions on both bodies.
struct StepPoint {
  int a = 0, b = -1;
  Vec3 where_m{}, normal{};          // world, in the poses that the points belong to
  std::array<Vec3, 2> stations_m{};  // on a and b, mesh frames; of the ground in the world
  double gap_m = 0.0;
  double impulse_n_s = 0.0;
  Vec3 friction_n_s{};
  double curvature_per_m = 0.0;  // NaN: unknown
  bool is_impulse_known = true, is_friction_known = true;
};

/// A step: the scene has the motions at its end. Lengths: one per body.
struct StepView {
  const Scene& scene;
  const std::vector<Motion>& before;  // motions at its start
  const std::vector<TouchBody>& bodies;
  const TouchesOptions& options;
  double dt_s = 0.0;

  const std::vector<Motion>& get_given() const { return options.points_after ? scene.motions : before; }
  bool moves(int body) const { return body >= 0 && !bodies[body].given.fixed; }
  /// World position of a point on a body; of the ground its world position.
  Vec3 place(const std::vector<Motion>& motions, int body, const Vec3& station) const {
    if (body < 0) return station;
    return motions[body].centre_m + motions[body].rotation * (station - scene.bodies[body].centre_m);
  }
  /// Velocity of a station of a body with the velocities of `motion`, in the pose of `pose` [m/s].
  Vec3 calc_velocity(int body, const Motion& motion, const Motion& pose, const Vec3& station) const {
    return motion.velocity_m_s + cross(motion.spin_rad_s, pose.rotation * (station - scene.bodies[body].centre_m));
  }
  /// Velocity of a relative to b at their stations [m/s]: velocities of `motions`, positions of `poses`.
  Vec3 calc_relative(const std::vector<Motion>& motions, const std::vector<Motion>& poses, int a, int b,
                     const std::array<Vec3, 2>& stations) const {
    const auto calc = [&](int body, const Vec3& station) {
      return body < 0 ? Vec3{} : calc_velocity(body, motions[body], poses[body], station);
    };
    return calc(a, stations[0]) - calc(b, stations[1]);
  }
  double calc_slowest() const {
    return options.slowest_m_s > 0.0 ? options.slowest_m_s : std::max(1e-3, 0.5 * norm(options.gravity_m_s2) * dt_s);
  }
  double calc_restitution(int a, int b) const {
    const double other = b < 0 ? options.ground_restitution : bodies[b].given.restitution;
    return std::sqrt(bodies[a].given.restitution * other);
  }
  double calc_friction(int a, int b) const {
    return std::sqrt(bodies[a].given.friction * (b < 0 ? options.ground_friction : bodies[b].given.friction));
  }
};

/// Surfaces of two bodies at a contact.
struct Curvatures {
  double a_per_m = 0.0, b_per_m = 0.0;          // of corners and edges, else of the smooth surfaces; 0 for the ground
  bool is_a_round = false, is_b_round = false;  // curved without edges: the contact may roll over it
  double calc_sum() const { return a_per_m + b_per_m; }
};

/// `stations` and `outwards`: points and outward normals of both surfaces, mesh axes.
Curvatures calc_curvatures(const StepView& step, int a, int b, const std::array<Vec3, 2>& stations, const std::array<Vec3, 2>& outwards);

/// Impulses of points that are not known: those that explain best how the velocities changed, by sweeps over the points.
void solve_impulses(const StepView& step, std::vector<StepPoint>& points);

}  // namespace carillon::drive
