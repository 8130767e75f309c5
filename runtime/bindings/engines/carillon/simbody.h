// The steps of a Simbody system for carillon_touches: header of the program that uses Simbody, C++17. docs/howto/my-engine.md
#ifndef CARILLON_SIMBODY_H
#define CARILLON_SIMBODY_H

#include <SimTKsimbody.h>
#include <carillon.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <map>
#include <utility>
#include <vector>

namespace carillon {

/// Poses and contact points of any MultibodySystem. Options of the carillon_touches: points_after 1, compliant 1 (impacts: 0).
/// One thread: that of the physics.
class SimbodyTouches {
 public:
  /// For compliant contact. All must outlive this object.
  SimbodyTouches(const SimTK::MultibodySystem& system, const SimTK::SimbodyMatterSubsystem& matter,
                 const SimTK::ContactTrackerSubsystem& tracker, const SimTK::CompliantContactSubsystem& contact, carillon_touches* touches)
      : system_(system), matter_(matter), tracker_(&tracker), contact_(&contact), touches_(touches) {}
  /// For impacts (SimTK::UnilateralContact): points come from add_point() only.
  SimbodyTouches(const SimTK::MultibodySystem& system, const SimTK::SimbodyMatterSubsystem& matter, carillon_touches* touches)
      : system_(system), matter_(matter), touches_(touches) {}

  /// `index` of carillon_touches_add, one after another from 0. Bodies that are not added are the ground. `mesh`: rotation of the frame of
  /// the bank's mesh in the body's frame. `flags`: CARILLON_JOINTED for bodies on joints.
  void add(SimTK::MobilizedBodyIndex body, std::int32_t index, std::uint32_t flags = 0u, const SimTK::Rotation& mesh = SimTK::Rotation()) {
    if (bodies_.size() <= static_cast<std::size_t>(index)) bodies_.resize(static_cast<std::size_t>(index) + 1);
    bodies_[static_cast<std::size_t>(index)] = {body, mesh, flags};
    indices_[body] = index;
  }

  /// Before the first step, and after the program has changed the state. Status and message as of carillon_touches_start.
  carillon_status start(const SimTK::State& state, char* message, std::size_t size) {
    read_poses(state);
    sums_.clear();
    forces_ = read_forces(state);
    last_s_ = state.getTime();
    return carillon_touches_start(touches_, last_s_, poses_.data(), static_cast<std::int32_t>(poses_.size()), message, size);
  }
  /// After each internal step of the integrator (setReturnEveryInternalStep(true)): adds its impulses, by the mean of the forces at both
  /// ends.
  void add_step(const SimTK::State& state) {
    const double step_s = state.getTime() - last_s_;
    if (!(step_s > 0)) return;
    Forces forces = read_forces(state);
    add(forces_, step_s / 2);
    add(forces, step_s / 2);
    forces_ = std::move(forces);
    last_s_ = state.getTime();
  }
  /// Adds a contact of bodies a and b (-1: the ground) that is no compliant one; call before step(). where: on b, in the world [m]; normal:
  /// unit, from b to a; gap: at the end of the step [m]. Its impulse is found from the velocities.
  void add_point(std::int32_t a, std::int32_t b, const SimTK::Vec3& where, const SimTK::UnitVec3& normal, double gap) {
    carillon_point point = carillon_point();
    point.a = a;
    point.b = b;
    copy(where, point.point_m);
    copy(SimTK::Vec3(normal), point.normal);
    copy(SimTK::Vec3(SimTK::NaN), point.friction_n_s);
    point.gap_m = gap;
    point.impulse_n_s = point.curvature_per_m = NAN;
    points_.push_back(point);
  }
  /// Hands over the steps added since the last call: each one, or those of a step of the program. Status and message as of
  /// carillon_touches_step.
  carillon_status step(const SimTK::State& state, char* message, std::size_t size) {
    read_poses(state);
    for (const auto& [pair, sum] : sums_) {
      const double impulse = sum.normal_n.norm();
      if (!(impulse > 0)) continue;
      carillon_point point = carillon_point();
      point.a = sum.a;
      point.b = sum.b;
      // Both bodies have moved on since they touched there.
      const SimTK::Vec3 normal = sum.normal_n / impulse;
      const SimTK::Vec3 on_a = locate(state, sum.a, sum.station_a_m / sum.weight_n),
                        on_b = locate(state, sum.b, sum.station_b_m / sum.weight_n);
      point.gap_m = SimTK::dot(on_a - on_b, normal);
      copy(sum.b < 0 ? on_a - point.gap_m * normal : (on_a + on_b - point.gap_m * normal) / 2, point.point_m);
      copy(normal, point.normal);
      // The friction of a sticking contact changes its sign at every step: it is found from the velocities instead; 0 for bodies on
      // joints, which change the velocities, too.
      copy(SimTK::Vec3(is_jointed(sum.a) || is_jointed(sum.b) ? 0.0 : SimTK::NaN), point.friction_n_s);
      point.impulse_n_s = impulse;
      point.curvature_per_m = NAN;  // of the surfaces of the banks
      points_.push_back(point);
    }
    sums_.clear();
    const std::vector<carillon_point> points = std::exchange(points_, {});
    return carillon_touches_step(touches_, state.getTime(), poses_.data(), static_cast<std::int32_t>(poses_.size()), points.data(),
                                 static_cast<std::int32_t>(points.size()), message, size);
  }

 private:
  struct Body {
    SimTK::MobilizedBodyIndex index;
    SimTK::Rotation mesh;
    std::uint32_t flags;
  };
  /// On body a; stations are in the frames of the bodies. In a sum: impulses, and stations times impulses.
  struct Force {
    std::int32_t a = -1, b = -1;
    SimTK::Vec3 normal_n{0.0}, station_a_m{0.0}, station_b_m{0.0};
    double weight_n = 0.0;
  };
  using Forces = std::map<std::pair<SimTK::ContactSurfaceIndex, SimTK::ContactSurfaceIndex>, Force>;

  static void copy(const SimTK::Vec3& from, double to[3]) {
    for (int k = 0; k < 3; ++k) to[k] = from[k];
  }
  std::int32_t find(SimTK::ContactSurfaceIndex surface) const {
    const auto found = indices_.find(tracker_->getMobilizedBody(surface).getMobilizedBodyIndex());
    return found == indices_.end() ? -1 : found->second;
  }

  void read_poses(const SimTK::State& state) {
    system_.realize(state, SimTK::Stage::Velocity);
    poses_.assign(bodies_.size(), carillon_pose());
    for (std::size_t i = 0; i < bodies_.size(); ++i) {
      carillon_pose& pose = poses_[i];
      pose.rotation[0] = 1.0;
      if (!bodies_[i].index.isValid()) continue;
      const SimTK::MobilizedBody& body = matter_.getMobilizedBody(bodies_[i].index);
      const SimTK::Vec3 centre = body.getBodyMassCenterStation(state);
      copy(body.findStationLocationInGround(state, centre), pose.position_m);
      copy(body.findStationVelocityInGround(state, centre), pose.velocity_m_s);
      copy(body.getBodyAngularVelocity(state), pose.spin_rad_s);
      const SimTK::Quaternion turn = SimTK::Rotation(body.getBodyRotation(state) * bodies_[i].mesh).convertRotationToQuaternion();
      for (int k = 0; k < 4; ++k) pose.rotation[k] = turn[k];
      pose.flags = bodies_[i].flags;
    }
  }
  bool is_jointed(std::int32_t body) const { return body >= 0 && (bodies_[static_cast<std::size_t>(body)].flags & CARILLON_JOINTED) != 0u; }
  void add(const Forces& forces, double weight_s) {
    for (const auto& [pair, force] : forces) {
      Force& sum = sums_[pair];
      sum.a = force.a;
      sum.b = force.b;
      sum.normal_n += weight_s * force.normal_n;
      sum.station_a_m += weight_s * force.weight_n * force.station_a_m;
      sum.station_b_m += weight_s * force.weight_n * force.station_b_m;
      sum.weight_n += weight_s * force.weight_n;
    }
  }
  /// A station of a body in the world; without body it is there already.
  SimTK::Vec3 locate(const SimTK::State& state, std::int32_t body, const SimTK::Vec3& station) const {
    if (body < 0) return station;
    return matter_.getMobilizedBody(bodies_[static_cast<std::size_t>(body)].index).findStationLocationInGround(state, station);
  }
  SimTK::Vec3 find_station(const SimTK::State& state, std::int32_t body, const SimTK::Vec3& point) const {
    if (body < 0) return point;
    return matter_.getMobilizedBody(bodies_[static_cast<std::size_t>(body)].index).findStationAtGroundPoint(state, point);
  }
  Forces read_forces(const SimTK::State& state) const {
    Forces forces;
    if (contact_ == nullptr) return forces;
    system_.realize(state, SimTK::Stage::Dynamics);
    const SimTK::ContactSnapshot& active = tracker_->getActiveContacts(state);
    for (int i = 0; i < contact_->getNumContactForces(state); ++i) {
      const SimTK::ContactForce& from = contact_->getContactForce(state, i);
      const SimTK::Contact& contact = active.getContactById(from.getContactId());
      const std::int32_t first = find(contact.getSurface1()), second = find(contact.getSurface2());
      const SimTK::Vec3 force = (second < 0 ? -1.0 : 1.0) * from.getForceOnSurface2()[1];
      SimTK::ContactPatch patch;
      if (first == second || !(force.norm() > 0) || !contact_->calcContactPatchDetailsById(state, from.getContactId(), patch)) continue;
      SimTK::Vec3 normal(0);  // of a mesh the mean of its elements
      for (int k = 0; k < patch.getNumDetails(); ++k)
        normal += patch.getContactDetail(k).getForceOnSurface2().norm() * patch.getContactDetail(k).getContactNormal();
      normal = normal.norm() > 0 ? normal.normalize() : force.normalize();
      Force& to = forces[{contact.getSurface1(), contact.getSurface2()}];
      to.a = second < 0 ? first : second;
      to.b = second < 0 ? -1 : first;
      to.normal_n = SimTK::dot(force, normal) * normal;
      to.weight_n = to.normal_n.norm();
      to.station_a_m = find_station(state, to.a, from.getContactPoint());
      to.station_b_m = find_station(state, to.b, from.getContactPoint());
    }
    return forces;
  }

  const SimTK::MultibodySystem& system_;
  const SimTK::SimbodyMatterSubsystem& matter_;
  const SimTK::ContactTrackerSubsystem* tracker_ = nullptr;
  const SimTK::CompliantContactSubsystem* contact_ = nullptr;
  carillon_touches* touches_;
  std::vector<Body> bodies_;
  std::map<SimTK::MobilizedBodyIndex, std::int32_t> indices_;
  Forces forces_, sums_;  // at the last internal step; impulses since the last step
  double last_s_ = 0.0;
  std::vector<carillon_pose> poses_;
  std::vector<carillon_point> points_;
};

}  // namespace carillon

#endif  // CARILLON_SIMBODY_H
