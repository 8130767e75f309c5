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
  double time_s = 0.0;
  std::vector<SimTK::Transform> poses;  // of the mesh frames, one a body
  std::vector<Mobile> mobiles;          // one a body; fixed ones cannot move
};

/// A point that holds a body up, where it is now, and how hard it pushes.
struct PushedPoint {
  TouchPoint touch;
  double push_n = 0.0;
};

/// What a body (-1: the ground) is made of.
struct Solid {
  double young_modulus_pa = 0.0;
  double poisson_ratio = 0.0;
  double density_kg_m3 = 0.0;
};

/// The names of all bodies, quoted, for messages.
std::string list_names(const WorldModel& world);

/// Surfaces by the address of the vertices they are made of: bodies of one bank share theirs.
using SurfaceSet = std::map<const void*, std::shared_ptr<const Surface>>;

class Engine {
 public:
  /// `world` must outlive the engine; surfaces that `surfaces` lacks are added to it. Throws InputError for a spec that cannot be
  /// simulated.
  Engine(const WorldModel& world, SurfaceSet& surfaces, double time_s, const WorldOptions& options);

  /// Throws InputError when two bodies, or a body and the ground, are inside each other.
  void check_overlaps() const;

  /// As the world says.
  const Snapshot& initial() const { return initial_; }

  /// The carrying points of every pair that cuts into each other.
  std::vector<TouchPoint> find_touches(const std::vector<SimTK::Transform>& poses) const;

  /// Which points hold the bodies up from now on.
  void set_resting(const std::vector<TouchPoint>& touches);

  /// The resting points that push at such places and speeds.
  std::vector<PushedPoint> calc_pushes(const Snapshot& now) const;

  /// Where everything is `step_s` later. Throws SolveError.
  Snapshot calc_advanced(const Snapshot& from, double step_s);

  /// No step may be longer than this, so that nothing passes through anything; while something is in touch, so that what comes down beside
  /// it is not far inside when it is seen.
  double calc_largest_step(const Snapshot& now, bool in_touch) const;

  ImpactPoint make_impact_point(const TouchPoint& touch) const;
  /// Points nearer to each other than this on a body belong to one spot [m].
  double spot_radius_m(int a, int b) const;
  const Surface& surface(int body) const { return *bodies_[body].surface; }
  const WorldModel& world() const { return world_; }
  bool is_fixed(int body) const { return world_.bodies[body].fixed; }
  Solid find_solid(int body) const;
  Elastic make_elastic(int body, const SimTK::Transform& pose, const SimTK::Vec3& where, const SimTK::Vec3& outward) const;

 private:
  struct Body {
    std::shared_ptr<const Surface> surface;
    SimTK::MobilizedBodyIndex mobilized{0};  // Ground when fixed
    SimTK::Transform frame;                  // of the mesh in the mobilized body
    SimTK::Vec3 centre{0};                   // in the mesh
    SimTK::Mat33 inertia{0};                 // about the centre, axes of the mesh
    SimTK::Mat33 inverse_inertia{0};
  };

  void add_body(const BodyModel& body, SurfaceSet& surfaces);
  Snapshot calc_flown(const Snapshot& from, double step_s) const;
  Mobile make_mobile(int body, const SimTK::Transform& pose, const SimTK::Vec3& velocity, const SimTK::Vec3& spin) const;

  const WorldModel& world_;
  double contact_step_s_ = 0.0;  // WorldOptions
  std::vector<Body> bodies_;
  SimTK::MultibodySystem system_;
  SimTK::SimbodyMatterSubsystem matter_;
  SimTK::GeneralForceSubsystem forces_;
  RestingForce* resting_ = nullptr;  // owned by forces_
  SimTK::State state_;               // what the integrator starts from
  Snapshot initial_;
  mutable std::map<std::pair<int, int>, NearFaces> near_;  // a memory only
  std::unique_ptr<SimTK::RungeKuttaMersonIntegrator> integrator_;
};

}  // namespace carillon::contact
