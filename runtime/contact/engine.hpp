// The Simbody side of a world: bodies, gravity, resting contacts; where everything is, how it moves, what touches, and one step on.
#pragma once

#include <Simbody.h>

#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "runtime/contact/impact.hpp"
#include "runtime/contact/model.hpp"
#include "runtime/contact/resting.hpp"
#include "runtime/contact/surface.hpp"
#include "runtime/contact/touch.hpp"

namespace carillon::contact {

/// Where all bodies are and how they move at one instant.
struct Snapshot {
  std::vector<SimTK::Transform> poses;  // of the mesh frames, one a body
  std::vector<Mobile> mobiles;          // one a body; fixed ones cannot move
};

/// The names of all bodies, quoted, for messages.
std::string list_names(const WorldModel& world);

class Engine {
 public:
  /// Throws InputError for a spec that cannot be simulated.
  explicit Engine(const WorldModel& world);

  const SimTK::State& initial_state() const { return initial_; }
  Snapshot calc_snapshot(const SimTK::State& state) const;
  void set_velocities(SimTK::State& state, const std::vector<Mobile>& mobiles) const;

  /// The carrying points of every pair that cuts into each other.
  std::vector<TouchPoint> find_touches(const std::vector<SimTK::Transform>& poses) const;

  /// Which points hold the bodies up from now on.
  void set_resting(const std::vector<TouchPoint>& touches);

  /// The state `step_s` later. Throws SolveError.
  SimTK::State calc_advanced(const SimTK::State& state, double step_s);

  /// No step may be longer than this, so that nothing passes through anything; while something is in touch, so that what comes down beside
  /// it is not far inside when it is seen.
  double calc_largest_step(const Snapshot& now, bool in_touch) const;

  ImpactPoint make_impact_point(const TouchPoint& touch) const;
  /// Points nearer to each other than this on a body belong to one spot [m].
  double spot_radius_m(int a, int b) const;
  const Surface& surface(int body) const { return *bodies_[body].surface; }
  const WorldModel& world() const { return world_; }
  bool is_fixed(int body) const { return world_.bodies[body].fixed; }
  Elastic make_elastic(int body, const SimTK::Transform& pose, const SimTK::Vec3& where, const SimTK::Vec3& outward) const;

 private:
  struct Body {
    std::shared_ptr<const Surface> surface;
    SimTK::MobilizedBodyIndex mobilized{0};  // Ground when fixed
    SimTK::Transform frame;                  // of the mesh in the mobilized body
  };

  void add_body(const BodyModel& body);
  void check_overlaps() const;

  const WorldModel& world_;
  std::vector<Body> bodies_;
  SimTK::MultibodySystem system_;
  SimTK::SimbodyMatterSubsystem matter_;
  SimTK::GeneralForceSubsystem forces_;
  RestingForce* resting_ = nullptr;  // owned by forces_
  SimTK::State initial_;
  mutable std::map<std::pair<int, int>, NearFaces> near_;  // a memory only
  std::unique_ptr<SimTK::RungeKuttaMersonIntegrator> integrator_;
};

}  // namespace carillon::contact
