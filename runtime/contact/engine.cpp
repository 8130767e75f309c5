// Method: what touches nothing flies by itself. Else one Simbody free joint per moving body, uniform gravity, a custom force for resting
// contacts; Runge-Kutta-Merson between the instants at
//   which the caller changes something.
// Source: M. Sherman, A. Seth, S. Delp, "Simbody: multibody dynamics for biomedical research", Procedia IUTAM 2 (2011).
// Deviations: Simbody's compliant contact subsystem is not used: it gives one force for a pair of meshes, its restitution depends on the
// speed,
//   and a contact soft enough to be integrated lasts milliseconds where the real one lasts a tenth of one.
#include "runtime/contact/engine.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "runtime/config/error.hpp"

namespace carillon::contact {
namespace {

using SimTK::dot;
using SimTK::MobilizedBody;
using SimTK::SpatialVec;
using SimTK::State;
using SimTK::Transform;
using Point = SimTK::Vec3;

constexpr double kLongestStep = 2e-3;  // s
constexpr double kTurn = 0.02;         // rad; of one Runge-Kutta step of a flight, which is then right to 1e-10 of it
constexpr double kSlowTouch = 0.01;    // m/s; of bodies in touch that move slower, steps get longer in proportion

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

Engine::Engine(const WorldModel& world, SurfaceSet& surfaces, double time_s, const WorldOptions& options)
    : world_(world), contact_step_s_(options.contact_step_s), matter_(system_), forces_(system_) {
  SimTK::Force::UniformGravity(forces_, matter_, to_vec(world.gravity_m_s2));
  resting_ = new RestingForce(matter_);
  SimTK::Force::Custom(forces_, resting_);
  for (const BodyModel& body : world.bodies) add_body(body, surfaces);
  system_.realizeTopology();
  state_ = system_.getDefaultState();
  initial_.time_s = time_s;
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    const BodyModel& body = world.bodies[i];
    initial_.poses.push_back(make_pose(body.initial));
    initial_.mobiles.push_back(
        make_mobile(static_cast<int>(i), initial_.poses[i], to_vec(body.velocity_m_s), to_vec(body.angular_velocity_rad_s)));
  }
  rested_s_ = time_s;
  integrator_ = std::make_unique<SimTK::RungeKuttaMersonIntegrator>(system_);
  integrator_->setAccuracy(1e-5);
}

void Engine::add_body(const BodyModel& body, SurfaceSet& surfaces) {
  Body made;
  std::shared_ptr<const Surface>& surface = surfaces[body.vertices_m];
  if (!surface) surface = std::make_shared<Surface>(*body.vertices_m, *body.triangles, body.name);
  made.surface = surface;
  if (body.fixed) {
    made.frame = make_pose(body.initial);  // the mobilized body is Ground
  } else {
    const auto& i = body.inertia_kg_m2;
    try {
      made.centre = to_vec(body.centre_m);
      made.inertia = SimTK::Mat33(i[0], i[1], i[2], i[3], i[4], i[5], i[6], i[7], i[8]);
      made.inverse_inertia = made.inertia.invert();
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
  const Snapshot& now = initial_;
  const int count = static_cast<int>(bodies_.size());
  const auto allowed_m = [&](int body) { return std::min(2e-4, 5e-3 * surface(body).size_m()); };
  for (int a = 0; a < count; ++a) {
    const Surface& sa = surface(a);
    if (world_.ground && !is_fixed(a)) {
      double lowest = SimTK::Infinity;
      for (int v = 0; v < sa.mesh().vertex_count(); ++v) lowest = std::min(lowest, (now.poses[a] * sa.vertex(v))[2]);
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

Mobile Engine::make_mobile(int body, const Transform& pose, const Point& velocity, const Point& spin) const {
  Mobile mobile;
  if (is_fixed(body)) return mobile;
  mobile.inverse_mass = 1.0 / world_.bodies[body].mass_kg;
  mobile.inverse_inertia = pose.R().asMat33() * bodies_[body].inverse_inertia * ~pose.R().asMat33();
  mobile.centre = pose * bodies_[body].centre;
  mobile.velocity = velocity;
  mobile.spin = spin;
  return mobile;
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

/// Free flight: a parabola, and a rotation of constant angular momentum L, q' = 1/2 (I(q)^-1 L) q, by the classical Runge-Kutta method.
Snapshot Engine::calc_flown(const Snapshot& from, double step_s) const {
  Snapshot to = from;
  to.time_s += step_s;
  const Point g = to_vec(world_.gravity_m_s2);
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    if (world_.bodies[i].fixed) continue;
    const Body& body = bodies_[i];
    const Mobile& m = from.mobiles[i];
    const Transform& X = from.poses[i];
    const Point momentum = X.R() * (body.inertia * (~X.R() * m.spin));
    const auto calc_spin = [&](const SimTK::Rotation& R) -> Point { return R * (body.inverse_inertia * (~R * momentum)); };
    const auto calc_rate = [&](const SimTK::Vec4& q) -> SimTK::Vec4 {
      const Point w = calc_spin(SimTK::Rotation(SimTK::Quaternion(q)));
      const Point u(q[1], q[2], q[3]);
      const Point v = q[0] * w + w % u;
      return 0.5 * SimTK::Vec4(-dot(w, u), v[0], v[1], v[2]);
    };
    SimTK::Vec4 q = X.R().convertRotationToQuaternion().asVec4();
    const int parts = std::max(1, static_cast<int>(std::ceil(std::min(m.spin.norm() * step_s / kTurn, 1e6))));
    const double h = step_s / parts;
    for (int part = 0; part < parts; ++part) {
      const SimTK::Vec4 k1 = calc_rate(q), k2 = calc_rate(q + 0.5 * h * k1), k3 = calc_rate(q + 0.5 * h * k2), k4 = calc_rate(q + h * k3);
      q += h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4);
    }
    const SimTK::Rotation R{SimTK::Quaternion(q)};  // normalises
    const Point centre = m.centre + step_s * m.velocity + 0.5 * step_s * step_s * g;
    to.poses[i] = Transform(R, centre - R * body.centre);
    to.mobiles[i] = make_mobile(static_cast<int>(i), to.poses[i], m.velocity + step_s * g, calc_spin(R));
  }
  return to;
}

Snapshot Engine::calc_advanced(const Snapshot& from, double step_s) {
  if (resting_->is_idle()) return calc_flown(from, step_s);
  try {
    // A fresh start: the forces may have been changed since the last step, and Simbody keeps the derivative of the state it ended with.
    state_.invalidateAllCacheAtOrAbove(SimTK::Stage::Dynamics);
    state_.setTime(from.time_s);
    for (std::size_t i = 0; i < bodies_.size(); ++i) {
      if (!world_.bodies[i].fixed) matter_.getMobilizedBody(bodies_[i].mobilized).setQToFitTransform(state_, from.poses[i]);
    }
    system_.realize(state_, SimTK::Stage::Position);
    for (std::size_t i = 0; i < bodies_.size(); ++i) {
      if (world_.bodies[i].fixed) continue;
      const Mobile& m = from.mobiles[i];
      matter_.getMobilizedBody(bodies_[i].mobilized)
          .setUToFitVelocity(state_, SpatialVec(m.spin, m.velocity + m.spin % (from.poses[i].p() - m.centre)));
    }
    const double end = from.time_s + step_s;
    integrator_->setFinalTime(-1);  // none
    integrator_->initialize(state_);
    integrator_->setInitialStepSize(step_s);
    while (integrator_->getTime() < end) {
      if (integrator_->stepTo(end, end) == SimTK::Integrator::EndOfSimulation) break;
    }
    const State& reached = integrator_->getState();
    if (!std::isfinite(reached.getY().normSqr()))
      throw SolveError(fmt::format("the motion is not finite after {:.6f} s", reached.getTime()));
    system_.realize(reached, SimTK::Stage::Velocity);
    Snapshot to = from;
    to.time_s = reached.getTime();
    for (std::size_t i = 0; i < bodies_.size(); ++i) {
      if (world_.bodies[i].fixed) continue;
      const MobilizedBody& m = matter_.getMobilizedBody(bodies_[i].mobilized);
      to.poses[i] = m.getBodyTransform(reached);
      to.mobiles[i] = make_mobile(static_cast<int>(i), to.poses[i], m.findStationVelocityInGround(reached, bodies_[i].centre),
                                  m.getBodyAngularVelocity(reached));
    }
    return to;
  } catch (const SimTK::Exception::Base& e) {
    throw SolveError(fmt::format("Simbody cannot integrate the motion of {} at {:.6f} s: {}", list_names(world_), from.time_s, e.what()));
  }
}

double Engine::calc_largest_step(const Snapshot& now, bool in_touch) const {
  double step = kLongestStep;
  double thinnest = SimTK::Infinity;
  for (const Body& body : bodies_) thinnest = std::min(thinnest, body.surface->thickness_m());
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    const double speed = now.mobiles[i].velocity.norm() + now.mobiles[i].spin.norm() * bodies_[i].surface->size_m();
    if (speed > 0.0) step = std::min(step, 0.25 * thinnest / speed);
    if (in_touch && speed > 0.0) step = std::min(step, std::max(contact_step_s_, contact_step_s_ * kSlowTouch / speed));
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

Solid Engine::find_solid(int body) const {
  if (body < 0) return {world_.ground->young_modulus_pa, world_.ground->poisson_ratio, world_.ground->density_kg_m3};
  const BodyModel& m = world_.bodies[body];
  return {m.young_modulus_pa, m.poisson_ratio, m.density_kg_m3};
}

Elastic Engine::make_elastic(int body, const Transform& pose, const Point& where, const Point& outward) const {
  if (body < 0) return {world_.ground->young_modulus_pa, world_.ground->poisson_ratio, 0.0};
  const BodyModel& m = world_.bodies[body];
  return {m.young_modulus_pa, m.poisson_ratio, surface(body).calc_curvature(~pose * where, ~pose.R() * outward)};
}

}  // namespace carillon::contact
