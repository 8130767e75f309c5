// The force of contacts that last: what holds a body up and brakes it while it lies or slides. Impacts are not its business.
#pragma once

#include <Simbody.h>

#include <vector>

#include "runtime/contact/touch.hpp"

namespace carillon::contact {

constexpr double kCreep = 2e-3;  // m/s; slower than this what friction holds may creep

/// One point that rests, with the stiffness of its share of the contact.
struct RestingPoint {
  TouchPoint touch;
  SimTK::MobilizedBodyIndex body_a, body_b;  // Ground for the ground and for fixed bodies
  SimTK::Transform frame_b;                  // of the mesh of b (or a) when it is fixed: its place in the world
  SimTK::Transform frame_a;
  double share = 1.0;  // of the load of its two bodies
  bool is_new = false;
  double offset_m = 0.0;  // depth at which the spring begins
  double stiffness_n_m = 0.0;
  double damping_n_s_m = 0.0;
  double friction = 0.0;
  double rolling_arm_m = 0.0;  // rolling resistance: moment per normal force
};

/// How hard the point pushes [N] when its spring is pressed so much [m] and the bodies part at that speed [m/s] along its normal and
/// turn against each other at that one: a body that rolls sets its corners down and takes them up, and must not be braked by that.
double calc_push(const RestingPoint& point, double pressed_m, double parting_m_s, double turning_rad_s);

/// Simbody force element: spring, damper and regularised Coulomb friction and rolling resistance at a list of points that is changed only
/// between steps.
class RestingForce : public SimTK::Force::Custom::Implementation {
 public:
  explicit RestingForce(const SimTK::SimbodyMatterSubsystem& matter) : matter_(matter) {}

  void set_points(std::vector<RestingPoint> points) { points_ = std::move(points); }
  const std::vector<RestingPoint>& points() const { return points_; }
  bool is_idle() const { return points_.empty(); }
  bool dependsOnlyOnPositions() const override { return false; }
  void calcForce(const SimTK::State& state, SimTK::Vector_<SimTK::SpatialVec>& body_forces, SimTK::Vector_<SimTK::Vec3>& particle_forces,
                 SimTK::Vector& mobility_forces) const override;
  SimTK::Real calcPotentialEnergy(const SimTK::State& state) const override;

 private:
  const SimTK::SimbodyMatterSubsystem& matter_;
  std::vector<RestingPoint> points_;
};

}  // namespace carillon::contact
