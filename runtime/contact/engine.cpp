// Method: one Simbody free joint per moving body, uniform gravity, a custom force for resting contacts; Runge-Kutta-Merson between the
// instants at
//   which the caller changes something.
// Source: M. Sherman, A. Seth, S. Delp, "Simbody: multibody dynamics for biomedical research", Procedia IUTAM 2 (2011).
// Deviations: Simbody's compliant contact subsystem is not used: it gives one force for a pair of meshes, its restitution depends on the
// speed,
//   and a contact soft enough to be integrated lasts milliseconds where the real one lasts a tenth of one.
#include "runtime/contact/engine.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "runtime/config/error.hpp"

namespace carillon::contact {
namespace {

using SimTK::MobilizedBody;
using SimTK::SpatialVec;
using SimTK::State;
using SimTK::Transform;
using Point = SimTK::Vec3;

constexpr double kSink = 2e-5;         // m; how far a resting body sinks into its contact under its own weight
constexpr double kRolling = 2e-3;      // rolling resistance arm over the size of the smaller body; hard bodies on hard floors: 1e-3 to 5e-3
constexpr double kLongestStep = 2e-3;  // s
constexpr double kContactStep = 5e-4;  // s; while something in touch moves by more than kContactDepth
constexpr double kContactDepth = 5e-6;  // m

Point to_vec(const std::array<double, 3>& x) { return {x[0], x[1], x[2]}; }

Transform make_pose(const Pose& pose) {
  const auto& q = pose.rotation;
  return {SimTK::Rotation(SimTK::Quaternion(SimTK::Vec4(q[0], q[1], q[2], q[3]))), to_vec(pose.position_m)};  // normalises
}

}  // namespace

std::string list_names(const WorldModel& world) {
  std::string names;
  for (const BodyModel& body : world.bodies) names += (names.empty() ? "'" : ", '") + body.name + "'";
  return names;
}

Engine::Engine(const WorldModel& world) : world_(world), matter_(system_), forces_(system_) {
  SimTK::Force::UniformGravity(forces_, matter_, to_vec(world.gravity_m_s2));
  resting_ = new RestingForce(matter_);
  SimTK::Force::Custom(forces_, resting_);
  for (const BodyModel& body : world.bodies) add_body(body);
  system_.realizeTopology();
  initial_ = system_.getDefaultState();
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    if (is_fixed(static_cast<int>(i))) continue;
    const BodyModel& body = world.bodies[i];
    const MobilizedBody& m = matter_.getMobilizedBody(bodies_[i].mobilized);
    const Transform pose = make_pose(body.initial);
    const Point spin = to_vec(body.angular_velocity_rad_s);
    m.setQToFitTransform(initial_, pose);
    system_.realize(initial_, SimTK::Stage::Position);
    m.setUToFitVelocity(initial_, SpatialVec(spin, to_vec(body.velocity_m_s) - spin % (pose.R() * to_vec(body.centre_m))));
  }
  check_overlaps();
  integrator_ = std::make_unique<SimTK::RungeKuttaMersonIntegrator>(system_);
  integrator_->setAccuracy(1e-5);
}

void Engine::add_body(const BodyModel& body) {
  Body made;
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    if (world_.bodies[i].vertices_m == body.vertices_m) made.surface = bodies_[i].surface;
  }
  if (!made.surface) made.surface = std::make_shared<Surface>(*body.vertices_m, *body.triangles, body.name);
  if (body.fixed) {
    made.frame = make_pose(body.initial);
  } else {
    const auto& i = body.inertia_kg_m2;
    try {
      const SimTK::Inertia about_centre(SimTK::SymMat33(i[0], i[3], i[4], i[6], i[7], i[8]));
      const Point centre = to_vec(body.centre_m);
      const SimTK::MassProperties mass(body.mass_kg, centre, about_centre.shiftFromMassCenter(centre, body.mass_kg));
      made.mobilized = MobilizedBody::Free(matter_.updGround(), SimTK::Body::Rigid(mass)).getMobilizedBodyIndex();
    } catch (const SimTK::Exception::Base& e) {
      throw InputError(fmt::format("body '{}': Simbody refuses its mass or inertia ({}); make the bank again", body.name, e.what()));
    }
  }
  bodies_.push_back(std::move(made));
}

void Engine::check_overlaps() const {
  const Snapshot now = calc_snapshot(initial_);
  const int count = static_cast<int>(bodies_.size());
  const auto allowed_m = [&](int body) { return std::min(2e-4, 5e-3 * surface(body).size_m()); };
  for (int a = 0; a < count; ++a) {
    const Surface& sa = surface(a);
    if (world_.ground && !is_fixed(a)) {
      double lowest = SimTK::Infinity;
      for (int v = 0; v < sa.mesh().getNumVertices(); ++v) lowest = std::min(lowest, (now.poses[a] * sa.vertex(v))[2]);
      const double depth = world_.ground->height_m - lowest;
      if (depth > allowed_m(a)) {
        throw InputError(fmt::format("body '{}' starts {:.2f} mm inside the ground (height {:g} m); raise it by that much",
                                     world_.bodies[a].name, depth * 1e3, world_.ground->height_m));
      }
    }
    for (int b = a + 1; b < count; ++b) {
      if (is_fixed(a) && is_fixed(b)) continue;
      Point where(0);
      const double depth = calc_overlap(sa, now.poses[a], surface(b), now.poses[b], where);
      if (depth > std::min(allowed_m(a), allowed_m(b))) {
        throw InputError(
            fmt::format("bodies '{}' and '{}' start inside each other, {:.2f} mm deep near ({:.4f}, {:.4f}, {:.4f}) m; move one of them",
                        world_.bodies[a].name, world_.bodies[b].name, depth * 1e3, where[0], where[1], where[2]));
      }
    }
  }
}

Snapshot Engine::calc_snapshot(const State& state) const {
  system_.realize(state, SimTK::Stage::Velocity);  // a copied State has lost its caches
  Snapshot now;
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    const MobilizedBody& m = matter_.getMobilizedBody(bodies_[i].mobilized);
    Mobile mobile;
    if (world_.bodies[i].fixed) {
      now.poses.push_back(bodies_[i].frame);
    } else {
      const BodyModel& r = world_.bodies[i];
      const auto& j = r.inertia_kg_m2;
      const Transform X = m.getBodyTransform(state);
      const SimTK::Mat33 inertia(j[0], j[1], j[2], j[3], j[4], j[5], j[6], j[7], j[8]);
      mobile.inverse_mass = 1.0 / r.mass_kg;
      mobile.inverse_inertia = X.R().asMat33() * inertia.invert() * ~X.R().asMat33();
      mobile.centre = X * to_vec(r.centre_m);
      mobile.velocity = m.findStationVelocityInGround(state, to_vec(r.centre_m));
      mobile.spin = m.getBodyAngularVelocity(state);
      now.poses.push_back(X);
    }
    now.mobiles.push_back(mobile);
  }
  return now;
}

void Engine::set_velocities(State& state, const std::vector<Mobile>& mobiles) const {
  const Snapshot now = calc_snapshot(state);  // before the first change, which takes the caches away
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    if (world_.bodies[i].fixed) continue;
    const Point to_origin = now.poses[i].p() - mobiles[i].centre;
    system_.realize(state, SimTK::Stage::Position);
    matter_.getMobilizedBody(bodies_[i].mobilized)
        .setUToFitVelocity(state, SpatialVec(mobiles[i].spin, mobiles[i].velocity + mobiles[i].spin % to_origin));
  }
}

std::vector<TouchPoint> Engine::find_touches(const std::vector<Transform>& poses) const {
  std::vector<TouchPoint> all;
  const int count = static_cast<int>(bodies_.size());
  for (int a = 0; a < count; ++a) {
    if (world_.ground && !is_fixed(a)) {
      const auto touches = find_ground_touches(a, surface(a), poses[a], world_.ground->height_m);
      all.insert(all.end(), touches.begin(), touches.end());
    }
    for (int b = a + 1; b < count; ++b) {
      if (is_fixed(a) && is_fixed(b)) continue;
      const auto touches = contact::find_touches(a, surface(a), poses[a], b, surface(b), poses[b], near_[{a, b}]);
      all.insert(all.end(), touches.begin(), touches.end());
    }
  }
  return all;
}

void Engine::set_resting(const std::vector<TouchPoint>& touches) {
  std::map<std::pair<int, int>, int> sharing;
  for (const TouchPoint& t : touches) ++sharing[{t.a, t.b}];
  const double omega = std::sqrt(std::max(to_vec(world_.gravity_m_s2).norm(), 1.0) / kSink);
  std::vector<RestingPoint> points;
  for (const TouchPoint& t : touches) {
    RestingPoint p;
    p.touch = t;
    p.body_a = bodies_[t.a].mobilized;
    p.frame_a = bodies_[t.a].frame;
    p.body_b = t.b >= 0 ? bodies_[t.b].mobilized : SimTK::MobilizedBodyIndex(0);
    if (t.b >= 0) p.frame_b = bodies_[t.b].frame;
    double inverse_mass = is_fixed(t.a) ? 0.0 : 1.0 / world_.bodies[t.a].mass_kg;
    if (t.b >= 0 && !is_fixed(t.b)) inverse_mass += 1.0 / world_.bodies[t.b].mass_kg;
    const double mass = 1.0 / inverse_mass / sharing[{t.a, t.b}];
    p.stiffness_n_m = mass * omega * omega;
    p.damping_n_s_m = 2.0 * mass * omega;  // critical
    p.rolling_arm_m = kRolling * 10.0 * spot_radius_m(t.a, t.b);
    p.friction = make_impact_point(t).friction;
    points.push_back(p);
  }
  resting_->set_points(std::move(points));
}

State Engine::calc_advanced(const State& state, double step_s) {
  try {
    // A fresh start: the forces may have been changed since the last step, and Simbody keeps the derivative of the state it ended with.
    State from = state;
    from.invalidateAllCacheAtOrAbove(SimTK::Stage::Dynamics);
    const double end = from.getTime() + step_s;
    integrator_->setFinalTime(-1);  // none
    integrator_->initialize(from);
    integrator_->setInitialStepSize(step_s);
    while (integrator_->getTime() < end) {
      if (integrator_->stepTo(end, end) == SimTK::Integrator::EndOfSimulation) break;
    }
    State to = integrator_->getState();
    if (!std::isfinite(to.getY().normSqr())) throw SolveError(fmt::format("the motion is not finite after {:.6f} s", to.getTime()));
    return to;
  } catch (const SimTK::Exception::Base& e) {
    throw SolveError(
        fmt::format("Simbody cannot integrate the motion of {} at {:.6f} s: {}", list_names(world_), state.getTime(), e.what()));
  }
}

double Engine::calc_largest_step(const Snapshot& now, bool in_touch) const {
  double step = kLongestStep;
  double thinnest = SimTK::Infinity;
  for (const Body& body : bodies_) thinnest = std::min(thinnest, body.surface->thickness_m());
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    const double speed = now.mobiles[i].velocity.norm() + now.mobiles[i].spin.norm() * bodies_[i].surface->size_m();
    if (speed > 0.0) step = std::min(step, 0.25 * thinnest / speed);
    if (in_touch && speed > 0.0) step = std::min(step, std::max(kContactStep, kContactDepth / speed));
  }
  return std::max(step, 2e-6);
}

ImpactPoint Engine::make_impact_point(const TouchPoint& t) const {
  const BodyModel& a = world_.bodies[t.a];
  ImpactPoint p;
  p.a = t.a;
  p.b = t.b;
  p.where = t.where;
  p.normal = t.normal;
  p.restitution = std::sqrt(a.restitution * (t.b >= 0 ? world_.bodies[t.b].restitution : world_.ground->restitution));
  p.friction = std::sqrt(a.friction * (t.b >= 0 ? world_.bodies[t.b].friction : world_.ground->friction));
  return p;
}

double Engine::spot_radius_m(int a, int b) const {
  const double size = b >= 0 ? std::min(surface(a).size_m(), surface(b).size_m()) : surface(a).size_m();
  return 0.1 * size;
}

Elastic Engine::make_elastic(int body, const Transform& pose, const Point& where, const Point& outward) const {
  if (body < 0) return {world_.ground->young_modulus_pa, world_.ground->poisson_ratio, 0.0};
  const BodyModel& m = world_.bodies[body];
  return {m.young_modulus_pa, m.poisson_ratio, surface(body).calc_curvature(~pose * where, ~pose.R() * outward)};
}

}  // namespace carillon::contact
