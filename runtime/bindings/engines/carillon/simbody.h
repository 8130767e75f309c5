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

/// Poses and contact points of any MultibodySystem with compliant contact. Options of the carillon_touches: points_after 1, compliant 1.
/// One thread: that of the physics.
class SimbodyTouches {
 public:
  /// All must outlive this object.
  SimbodyTouches(const SimTK::MultibodySystem& system, const SimTK::SimbodyMatterSubsystem& matter,
                 const SimTK::ContactTrackerSubsystem& tracker, const SimTK::CompliantContactSubsystem& contact, carillon_touches* touches)
      : system_(system), matter_(matter), tracker_(tracker), contact_(contact), touches_(touches) {}

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
    const double half_s = 0.5 * (state.getTime() - last_s_);
    if (!(half_s > 0)) return;
    std::map<SimTK::ContactId, Force> forces = read_forces(state);
    for (const auto* end : {&forces_, &forces})
      for (const auto& [id, force] : *end) {
        Force& sum = sums_.try_emplace(id, Force{force.point, SimTK::Vec3(0), SimTK::Vec3(0)}).first->second;
        sum.point = force.point;
        sum.normal_n += half_s * force.normal_n;
        sum.friction_n += half_s * force.friction_n;
      }
    forces_ = std::move(forces);
    last_s_ = state.getTime();
  }
  /// Hands over the steps added since the last call: each one, or those of a step of the program. Status and message as of
  /// carillon_touches_step.
  carillon_status step(const SimTK::State& state, char* message, std::size_t size) {
    read_poses(state);
    points_.clear();
    for (auto& [id, sum] : sums_) {
      const double impulse = sum.normal_n.norm();
      if (!(impulse > 0)) continue;
      copy(sum.normal_n / impulse, sum.point.normal);
      copy(sum.friction_n, sum.point.friction_n_s);
      sum.point.impulse_n_s = impulse;
      points_.push_back(sum.point);
    }
    sums_.clear();
    return carillon_touches_step(touches_, state.getTime(), poses_.data(), static_cast<std::int32_t>(poses_.size()), points_.data(),
                                 static_cast<std::int32_t>(points_.size()), message, size);
  }

 private:
  struct Body {
    SimTK::MobilizedBodyIndex index;
    SimTK::Rotation mesh;
    std::uint32_t flags;
  };
  /// On body a of the point; in a sum the impulses.
  struct Force {
    carillon_point point;
    SimTK::Vec3 normal_n, friction_n;
  };
  static void copy(const SimTK::Vec3& from, double to[3]) {
    for (int k = 0; k < 3; ++k) to[k] = from[k];
  }
  std::int32_t find(SimTK::ContactSurfaceIndex surface) const {
    const auto found = indices_.find(tracker_.getMobilizedBody(surface).getMobilizedBodyIndex());
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
  std::map<SimTK::ContactId, Force> read_forces(const SimTK::State& state) const {
    system_.realize(state, SimTK::Stage::Dynamics);
    std::map<SimTK::ContactId, Force> forces;
    const SimTK::ContactSnapshot& active = tracker_.getActiveContacts(state);
    for (int i = 0; i < contact_.getNumContactForces(state); ++i) {
      const SimTK::ContactForce& from = contact_.getContactForce(state, i);
      const SimTK::Contact& contact = active.getContactById(from.getContactId());
      const std::int32_t first = find(contact.getSurface1()), second = find(contact.getSurface2());
      SimTK::Vec3 force = from.getForceOnSurface2()[1];
      SimTK::ContactPatch patch;
      if (first == second || !(force.norm() > 0) || !contact_.calcContactPatchDetailsById(state, from.getContactId(), patch)) continue;
      SimTK::Vec3 normal(0);  // of a mesh the mean of its elements
      for (int k = 0; k < patch.getNumDetails(); ++k)
        normal += patch.getContactDetail(k).getForceOnSurface2().norm() * patch.getContactDetail(k).getContactNormal();
      normal = normal.norm() > 0 ? normal.normalize() : force.normalize();
      Force to = {carillon_point(), normal, SimTK::Vec3(0)};
      to.point.a = second < 0 ? first : second;
      to.point.b = second < 0 ? -1 : first;
      if (second < 0) force = -force;
      to.normal_n = SimTK::dot(force, normal) * normal;
      to.friction_n = force - to.normal_n;
      copy(from.getContactPoint(), to.point.point_m);
      to.point.curvature_per_m = NAN;  // of the surfaces of the banks
      forces.emplace(from.getContactId(), to);
    }
    return forces;
  }

  const SimTK::MultibodySystem& system_;
  const SimTK::SimbodyMatterSubsystem& matter_;
  const SimTK::ContactTrackerSubsystem& tracker_;
  const SimTK::CompliantContactSubsystem& contact_;
  carillon_touches* touches_;
  std::vector<Body> bodies_;
  std::map<SimTK::MobilizedBodyIndex, std::int32_t> indices_;
  std::map<SimTK::ContactId, Force> forces_, sums_;  // at the last internal step; impulses since the last step
  double last_s_ = 0.0;
  std::vector<carillon_pose> poses_;
  std::vector<carillon_point> points_;
};

}  // namespace carillon

#endif  // CARILLON_SIMBODY_H
