// Checks a world and hands it to the Simbody side (model.hpp says why that is apart).
#include "runtime/contact/world.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <variant>

#include "runtime/config/error.hpp"
#include "runtime/contact/model.hpp"

namespace carillon::contact {
namespace {

bool is_finite(const Vec3& x) { return std::isfinite(x[0]) && std::isfinite(x[1]) && std::isfinite(x[2]); }

bool is_zero(const Vec3& x) { return x[0] == 0.0 && x[1] == 0.0 && x[2] == 0.0; }

void check_contact_numbers(const std::string& who, double restitution, double friction, double young, double poisson) {
  if (!(restitution >= 0.0 && restitution <= 1.0)) throw InputError(fmt::format("{}: restitution {} is not within 0..1", who, restitution));
  if (!(friction >= 0.0 && std::isfinite(friction)))
    throw InputError(fmt::format("{}: friction {} must be a finite number, 0 or more", who, friction));
  if (!(young > 0.0 && std::isfinite(young)))
    throw InputError(fmt::format("{}: young_modulus_pa {} must be a finite number above 0", who, young));
  if (!(poisson > -1.0 && poisson <= 0.5)) throw InputError(fmt::format("{}: poisson_ratio {} is not within -1..0.5", who, poisson));
}

/// Sylvester's criterion, with a tolerance relative to the trace. A NaN fails as well.
bool is_positive_definite(const std::array<double, 9>& m, double tolerance) {
  const double trace = m[0] + m[4] + m[8];
  const double minor2 = m[0] * m[4] - m[1] * m[3];
  const double minor3 = m[0] * (m[4] * m[8] - m[5] * m[7]) - m[1] * (m[3] * m[8] - m[5] * m[6]) + m[2] * (m[3] * m[7] - m[4] * m[6]);
  return std::isfinite(trace) && m[0] > tolerance * trace && minor2 > tolerance * trace * trace &&
         minor3 > tolerance * trace * trace * trace;
}

void check_rigid(const std::string& who, const bank::RigidBody& r) {
  if (!(r.mass_kg > 0.0 && std::isfinite(r.mass_kg)) || !is_finite(r.centre_m)) {
    throw InputError(fmt::format("{}: mass {} kg or centre in its bank is unusable; make the bank again", who, r.mass_kg));
  }
  const auto& i = r.inertia_kg_m2;
  if (!is_positive_definite(i, 0.0)) throw InputError(who + ": the inertia in its bank is not positive definite; make the bank again");
  // tr(I)/2 - I is the integral of x x^T over the mass, which no mass distribution makes negative.
  const double half_trace = 0.5 * (i[0] + i[4] + i[8]);
  const std::array<double, 9> second{half_trace - i[0], -i[1], -i[2], -i[3], half_trace - i[4], -i[5], -i[6], -i[7], half_trace - i[8]};
  if (!is_positive_definite(second, -1e-9)) {
    throw InputError(
        who + ": no body can have the inertia in its bank (one principal moment exceeds the sum of the others); make the bank again");
  }
}

void check_body(const BodySpec& b) {
  const std::string who = fmt::format("body '{}'", b.name);
  if (b.bank == nullptr) throw InputError(who + ": has no bank; name the file of its mode bank");
  check_contact_numbers(who, b.restitution, b.friction, b.bank->material.young_modulus_pa, b.bank->material.poisson_ratio);
  if (!is_finite(b.initial.position_m) || !is_finite(b.velocity_m_s) || !is_finite(b.angular_velocity_rad_s)) {
    throw InputError(who + ": position, velocity and angular velocity must be finite numbers");
  }
  const auto& q = b.initial.rotation;
  const double norm = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
  if (!(norm > 1e-12 && std::isfinite(norm))) {
    throw InputError(who + ": the rotation (quaternion w x y z) is zero or not finite; use 1 0 0 0 for none");
  }
  if (!b.fixed) {
    check_rigid(who, b.bank->rigid);
  } else if (!is_zero(b.velocity_m_s) || !is_zero(b.angular_velocity_rad_s)) {
    throw InputError(who + ": is fixed but has a velocity; take one of the two away");
  }
}

BodyModel make_body(const BodySpec& b) {
  BodyModel m;
  m.name = b.name;
  m.vertices_m = &b.bank->vertices_m;
  m.triangles = &b.bank->triangles;
  m.fixed = b.fixed;
  m.initial = b.initial;
  m.velocity_m_s = b.velocity_m_s;
  m.angular_velocity_rad_s = b.angular_velocity_rad_s;
  m.mass_kg = b.bank->rigid.mass_kg;
  m.centre_m = b.bank->rigid.centre_m;
  m.inertia_kg_m2 = b.bank->rigid.inertia_kg_m2;
  m.young_modulus_pa = b.bank->material.young_modulus_pa;
  m.poisson_ratio = b.bank->material.poisson_ratio;
  m.density_kg_m3 = b.bank->material.density_kg_m3;
  m.restitution = b.restitution;
  m.friction = b.friction;
  return m;
}

WorldModel make_model(const WorldSpec& spec) {
  if (!is_finite(spec.gravity_m_s2)) throw InputError("gravity must be three finite numbers");
  WorldModel world;
  world.gravity_m_s2 = spec.gravity_m_s2;
  if (spec.ground) {
    const GroundSpec& g = *spec.ground;
    if (!std::isfinite(g.height_m)) throw InputError("ground: the height must be a finite number");
    if (!(g.density_kg_m3 > 0.0 && std::isfinite(g.density_kg_m3))) throw InputError("ground: the density must be a finite number above 0");
    check_contact_numbers("ground", g.restitution, g.friction, g.young_modulus_pa, g.poisson_ratio);
    world.ground = GroundModel{g.height_m, g.young_modulus_pa, g.poisson_ratio, g.density_kg_m3, g.restitution, g.friction};
  }
  for (const BodySpec& body : spec.bodies) {
    check_body(body);
    world.bodies.push_back(make_body(body));
  }
  return world;
}

}  // namespace

World::World(const WorldSpec& spec, const WorldOptions& options) {
  if (!(options.end_s >= 0.0)) throw InputError(fmt::format("the end of the world, {} s, must be a number, 0 or more", options.end_s));
  if (!(options.contact_step_s >= 2e-6 && options.contact_step_s <= 2e-3))
    throw InputError(fmt::format("the step of contacts, {} s, must lie within 2e-6 and 0.002 s", options.contact_step_s));
  runner_ = std::make_unique<Runner>(make_model(spec), options);
}

World::~World() = default;
World::World(World&&) noexcept = default;
World& World::operator=(World&&) noexcept = default;

double World::advance(double until_s, double cpu_s, const std::function<void(const stream::Event&)>& sink) {
  return runner_->advance(until_s, cpu_s, sink);
}

Statistics World::get_statistics() const { return runner_->get_statistics(); }

Pose calc_pose(const stream::Motion& motion, const Vec3& c) {
  const auto& q = motion.rotation;
  const Vec3 u{q[1], q[2], q[3]};
  const auto cross = [](const Vec3& a, const Vec3& b) {
    return Vec3{a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
  };
  const Vec3 t = cross(u, c), s = cross(u, t);
  Pose pose{motion.time_s, motion.position_m, q};
  for (std::size_t k = 0; k < 3; ++k) pose.position_m[k] -= c[k] + 2.0 * (q[0] * t[k] + s[k]);
  return pose;
}

Simulation collect(const std::vector<stream::Event>& events, const std::vector<Vec3>& centres_m) {
  Simulation all;
  all.poses.resize(centres_m.size());
  const auto is_known = [&](std::int32_t body) { return body >= 0 && static_cast<std::size_t>(body) < centres_m.size(); };
  for (const stream::Event& event : events) {
    if (const auto* impulse = std::get_if<Impulse>(&event); impulse != nullptr && is_known(impulse->body)) {
      all.impulses.push_back(*impulse);
    } else if (const auto* motion = std::get_if<stream::Motion>(&event); motion != nullptr && is_known(motion->body)) {
      const auto body = static_cast<std::size_t>(motion->body);
      auto& path = all.poses[body];
      if (!path.empty() && path.back().time_s >= motion->time_s) continue;  // after an impact it is where it was before
      path.push_back(calc_pose(*motion, centres_m[body]));
    }
  }
  const auto earlier = [](const Impulse& x, const Impulse& y) { return x.time_s < y.time_s; };
  std::stable_sort(all.impulses.begin(), all.impulses.end(), earlier);
  return all;
}

Simulation simulate(const WorldSpec& spec, double duration_s, const std::function<void(double)>& progress) {
  if (!(duration_s >= 0.0 && std::isfinite(duration_s)))
    throw InputError(fmt::format("the duration {} s must be a finite number, 0 or more", duration_s));
  World world(spec, {.end_s = duration_s, .lasting_contacts = false});
  std::vector<stream::Event> events;
  constexpr int kParts = 100;
  for (int part = 1; part <= kParts; ++part) {
    world.advance(duration_s * part / kParts, std::numeric_limits<double>::infinity(),
                  [&](const stream::Event& event) { events.push_back(event); });
    if (progress) progress(static_cast<double>(part) / kParts);
  }
  std::vector<Vec3> centres_m;
  for (const BodySpec& body : spec.bodies) centres_m.push_back(body.bank->rigid.centre_m);
  Simulation all = collect(events, centres_m);
  const Statistics cost = world.get_statistics();
  all.steps = cost.steps;
  all.seconds_cpu = cost.seconds_cpu;
  return all;
}

}  // namespace carillon::contact
