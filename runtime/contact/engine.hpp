// The Simbody side of a world: bodies, gravity, resting contacts; where everything is, how it moves, what touches, and one step on.
#pragma once

#include <Simbody.h>

#include <array>
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

/// A point that has held a body up: how much of the load of its pair its spring takes, and at which depth it begins.
struct RestedPoint {
  int a = 0, b = -1;
  std::array<int, 3> feature{};
  double share = 1.0, offset_m = 0.0;
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

  /// Adds the points that hold bodies up and are still pressed where they were, though they are no touches any more: on the brim of a face,
  /// or between edges that lie along each other, a point comes and goes with the slightest sway.
  void add_held(std::vector<TouchPoint>& touches, const Snapshot& now) const;

  /// Which points hold the bodies up from now on.
  void set_resting(const std::vector<TouchPoint>& touches, const Snapshot& now);

  /// What the points that hold the bodies up carry over from one engine to another.
  const std::vector<RestedPoint>& get_rested() const { return rested_; }
  void set_rested(std::vector<RestedPoint> rested) { rested_ = std::move(rested); }

  /// The resting points that push at such places and speeds.
  std::vector<PushedPoint> calc_pushes(const Snapshot& now) const;

  /// Where everything is `step_s` later. Throws SolveError.
  Snapshot calc_advanced(const Snapshot& from, double step_s);

  /// No step may be longer than this, so that nothing passes through anything; while something is in touch, so that what comes down beside
  /// it is not far inside when it is seen.
  double calc_largest_step(const Snapshot& now, bool in_touch) const;

  /// Of the bodies that move, and of the springs that hold them up [J]; gravity counts from the origin.
  double calc_energy_j(const Snapshot& now) const;
  double calc_kinetic_j(const Snapshot& now) const;

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

  RestingPoint make_resting(const TouchPoint& touch) const;
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
  std::vector<RestedPoint> rested_;  // its points as they were set
  double rested_s_ = 0.0;            // when
  SimTK::State state_;               // what the integrator starts from
  Snapshot initial_;
  mutable std::map<std::pair<int, int>, NearFaces> near_;  // a memory only
  std::unique_ptr<SimTK::RungeKuttaMersonIntegrator> integrator_;
};

}  // namespace carillon::contact
