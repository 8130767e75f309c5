// Checks a world and hands it to the Simbody side (model.hpp says why that is apart).
#include "runtime/contact/world.hpp"

#include <fmt/format.h>

#include <cmath>

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
  m.restitution = b.restitution;
  m.friction = b.friction;
  return m;
}

}  // namespace

Simulation simulate(const WorldSpec& spec, double duration_s, const std::function<void(double)>& progress) {
  if (!(duration_s >= 0.0 && std::isfinite(duration_s)))
    throw InputError(fmt::format("the duration {} s must be a finite number, 0 or more", duration_s));
  if (!is_finite(spec.gravity_m_s2)) throw InputError("gravity must be three finite numbers");
  WorldModel world;
  world.gravity_m_s2 = spec.gravity_m_s2;
  if (spec.ground) {
    const GroundSpec& g = *spec.ground;
    if (!std::isfinite(g.height_m)) throw InputError("ground: the height must be a finite number");
    check_contact_numbers("ground", g.restitution, g.friction, g.young_modulus_pa, g.poisson_ratio);
    world.ground = GroundModel{g.height_m, g.young_modulus_pa, g.poisson_ratio, g.restitution, g.friction};
  }
  for (const BodySpec& body : spec.bodies) {
    check_body(body);
    world.bodies.push_back(make_body(body));
  }
  return run_simulation(world, duration_s, progress);
}

}  // namespace carillon::contact
