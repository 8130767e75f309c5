// Checks of a world's description before simulation. Each fault is one InputError that names the body, joint or cord.
#include "runtime/physics/check.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include "runtime/base/definite.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/groups.hpp"
#include "runtime/physics/rigid/body.hpp"

namespace carillon::physics {
namespace {

constexpr double kMaxHingeRad = kWidestHingeDeg * std::numbers::pi / 180.0 * (1.0 + 1e-12);  // rad; tolerance for rounding of degrees

bool is_zero(const Vec3& x) { return x[0] == 0.0 && x[1] == 0.0 && x[2] == 0.0; }

void check_contact_numbers(const std::string& who, double restitution, double friction, double rolling, double young, double poisson) {
  if (!(restitution >= 0.0 && restitution <= 1.0)) throw InputError(fmt::format("{}: restitution {} is not within 0..1", who, restitution));
  if (!(friction >= 0.0 && std::isfinite(friction)))
    throw InputError(fmt::format("{}: friction {} must be a finite number, 0 or more", who, friction));
  if (!(rolling >= 0.0 && std::isfinite(rolling)))
    throw InputError(fmt::format("{}: rolling_resistance {} must be a finite number, 0 or more", who, rolling));
  if (!(young > 0.0 && std::isfinite(young)))
    throw InputError(fmt::format("{}: young_modulus_pa {} must be a finite number above 0", who, young));
  if (!(poisson > -1.0 && poisson <= 0.5)) throw InputError(fmt::format("{}: poisson_ratio {} is not within -1..0.5", who, poisson));
}

void check_rigid(const std::string& who, const bank::RigidBody& r) {
  if (!(r.mass_kg > 0.0 && std::isfinite(r.mass_kg)) || !is_finite(r.centre_m)) {
    throw InputError(fmt::format("{}: invalid mass {} kg or centre of mass in its bank; make the bank again", who, r.mass_kg));
  }
  const auto& i = r.inertia_kg_m2;
  if (!is_positive_definite(make_matrix(i)))
    throw InputError(who + ": the inertia in its bank is not positive definite; make the bank again");
  // tr(I)/2 - I is the integral of x x^T over the mass, which is positive semidefinite for any mass distribution.
  const double half_trace = 0.5 * (i[0] + i[4] + i[8]);
  const std::array<double, 9> second{half_trace - i[0], -i[1], -i[2], -i[3], half_trace - i[4], -i[5], -i[6], -i[7], half_trace - i[8]};
  if (!is_positive_definite(make_matrix(second), -1e-9)) {
    throw InputError(who + ": impossible inertia in its bank (one principal moment exceeds the sum of the others); make the bank again");
  }
}

void check_joints(const WorldSpec& spec) {
  const int count = static_cast<int>(spec.bodies.size());
  const auto is_fixed = [&](int body) { return body < 0 || spec.bodies[body].fixed; };
  const auto check_ends = [&](const std::string& place, const char* what, int body, int to) {
    if (body < 0 || body >= count || to < -1 || to >= count) throw InputError(fmt::format("{}: a {} names no body", place, what));
    for (const int end : {body, to})
      if (end >= 0 && spec.bodies[end].absent)
        throw InputError(fmt::format("{} holds '{}', which is absent at the start; remove one of the two",
                                     describe(spec, place, what, body, to), spec.bodies[end].name));
    std::string who = describe(spec, place, what, body, to);
    if (body == to) throw InputError(who + " connects a body to itself; name another body, or \"world\"");
    if (is_fixed(body) && is_fixed(to)) throw InputError(who + " connects two bodies that do not move");
    return who;
  };
  base::Groups groups(count + 1);  // the last: static bodies and the world
  const auto find = [&](int body) { return is_fixed(body) ? count : body; };
  for (const JointSpec& joint : spec.joints) {
    const std::string who = check_ends(joint.place, "joint", joint.body, joint.to);
    if (!is_finite(joint.at_m)) throw InputError(who + ": its position must be three finite numbers");
    const bool has_axis =
        joint.kind == joints::Kind::kHinge || joint.kind == joints::Kind::kSlider || joint.kind == joints::Kind::kUniversal;
    if (has_axis && !(std::abs(calc_length(joint.axis) - 1.0) < 1e-6)) throw InputError(who + ": its axis is not a unit vector");
    if (joint.kind == joints::Kind::kUniversal &&
        !(std::abs(calc_length(joint.second_axis) - 1.0) < 1e-6 && std::abs(dot(joint.axis, joint.second_axis)) < 1e-6))
      throw InputError(who + ": its second axis is not a unit vector perpendicular to the first");
    if (!(joint.damping >= 0.0 && std::isfinite(joint.damping)))
      throw InputError(fmt::format("{}: damping {} must be a finite number, 0 or more", who, joint.damping));
    if (joint.limits) {
      const auto [low, high] = *joint.limits;
      const bool turns = joint.kind == joints::Kind::kHinge;
      if (!turns && joint.kind != joints::Kind::kSlider) throw InputError(who + ": only hinges and sliders have limits");
      if (!(low <= 0.0 && high >= 0.0 && high - low > 1e-6 && std::isfinite(high - low)))
        throw InputError(fmt::format("{}: its limits {:g} and {:g} must enclose the start, which is 0", who, low, high));
      if (turns && !(low >= -kMaxHingeRad && high <= kMaxHingeRad))
        throw InputError(
            fmt::format("{}: its limits must be within {:g} rad of the start; omit limits beyond the range of motion", who, kMaxHingeRad));
      if (!(joint.stop_restitution >= 0.0 && joint.stop_restitution <= 1.0))
        throw InputError(fmt::format("{}: the restitution {} of its stops is not within 0..1", who, joint.stop_restitution));
    }
    if (joint.kind == joints::Kind::kWeld && (is_fixed(joint.body) || is_fixed(joint.to)))
      throw InputError(who + " welds a body to one that does not move; set \"fixed\" of that body to true instead");
    if (groups.find(find(joint.body)) == groups.find(find(joint.to)))
      throw InputError(who + " closes a loop of joints, which is not supported; replace one joint of the loop by a cord, or remove one");
    groups.join(find(joint.body), find(joint.to));
  }
  for (const CordSpec& cord : spec.cords) {
    const std::string who = check_ends(cord.place, "cord", cord.body, cord.to);
    if (!is_finite(cord.from_m) || !is_finite(cord.to_m)) throw InputError(who + ": its ends must be finite numbers");
    const double distance = calc_length(cord.from_m - cord.to_m);
    if (!(cord.restitution >= 0.0 && cord.restitution <= 1.0))
      throw InputError(fmt::format("{}: restitution {} is not within 0..1", who, cord.restitution));
    if (!(distance > 1e-4)) throw InputError(who + ": its ends coincide; use a ball joint, or ends that differ");
    if (cord.length_m && !(*cord.length_m >= distance - 1e-9 && std::isfinite(*cord.length_m)))
      throw InputError(fmt::format("{}: it is {:.6g} m long, and its ends are {:.6g} m apart at the start; increase its length, or omit it",
                                   who, *cord.length_m, distance));
  }
}

}  // namespace

std::string describe(const WorldSpec& spec, const std::string& place, const char* what, int body, int to) {
  const auto name = [&](int b) { return b < 0 ? std::string("the world") : fmt::format("'{}'", spec.bodies[b].name); };
  return fmt::format("{}{}the {} between {} and {}", place, place.empty() ? "" : ": ", what, name(body), name(to));
}

void check_entry(const BodySpec& b) {
  const std::string who = fmt::format("body '{}'", b.name);
  if (!is_finite(b.initial.position_m) || !is_finite(b.velocity_m_s) || !is_finite(b.angular_velocity_rad_s)) {
    throw InputError(who + ": position, velocity and angular velocity must be finite numbers");
  }
  const auto& q = b.initial.rotation;
  const double norm = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
  if (!(norm > 1e-12 && std::isfinite(norm))) {
    throw InputError(who + ": the rotation (quaternion w x y z) is zero or not finite; use 1 0 0 0 for no rotation");
  }
  if (b.fixed && !(is_zero(b.velocity_m_s) && is_zero(b.angular_velocity_rad_s)))
    throw InputError(who + ": is fixed but has a velocity; remove one of the two");
}

void check_body(const BodySpec& b) {
  const std::string who = fmt::format("body '{}'", b.name);
  if (b.bank == nullptr) throw InputError(who + ": has no bank; name the file of its mode bank");
  check_contact_numbers(who, b.restitution, b.friction, b.rolling_resistance, b.bank->material.young_modulus_pa,
                        b.bank->material.poisson_ratio);
  check_entry(b);
  if (!b.fixed) check_rigid(who, b.bank->rigid);
}

void check(const WorldSpec& spec, const WorldOptions& options) {
  if (!(options.end_s >= 0.0)) throw InputError(fmt::format("the end time {} s must be a number, 0 or more", options.end_s));
  if (!(options.contact_step_s >= 2e-6 && options.contact_step_s <= 2e-3))
    throw InputError(fmt::format("the step of contacts, {} s, must lie within 2e-6 and 0.002 s", options.contact_step_s));
  if (!is_finite(spec.gravity_m_s2)) throw InputError("gravity must be three finite numbers");
  if (spec.ground) {
    const GroundSpec& g = *spec.ground;
    if (!std::isfinite(g.height_m)) throw InputError("ground: the height must be a finite number");
    if (!(g.density_kg_m3 > 0.0 && std::isfinite(g.density_kg_m3))) throw InputError("ground: the density must be a finite number above 0");
    check_contact_numbers("ground", g.restitution, g.friction, g.rolling_resistance, g.young_modulus_pa, g.poisson_ratio);
  }
  for (const BodySpec& body : spec.bodies) check_body(body);
  check_joints(spec);
}

std::vector<std::string> ask_about_links(const WorldSpec& spec) {
  constexpr double kFarRadii = 30.0;  // radii of a body
  std::vector<std::string> questions;
  const auto calc_distance = [&](int body, const Vec3& where, double& radius) {
    const BodySpec& b = spec.bodies[body];
    radius = 0.0;
    for (const Vec3& v : b.bank->vertices_m) radius = std::max(radius, norm(v - b.bank->rigid.centre_m));
    const Mat3 rotation = rigid::make_rotation(rigid::normalise(b.initial.rotation));
    return norm(where - b.initial.position_m - rotation * b.bank->rigid.centre_m);
  };
  const auto name = [&](int body) { return spec.bodies[body].name; };
  for (const JointSpec& joint : spec.joints) {
    bool far = true;
    double nearest = std::numeric_limits<double>::infinity(), of = 0.0;
    int body = joint.body;
    for (const int one : {joint.body, joint.to}) {
      if (one < 0) continue;
      double radius = 0.0;
      const double distance = calc_distance(one, joint.at_m, radius);
      far = far && distance > kFarRadii * radius;
      if (distance < nearest) nearest = distance, of = radius, body = one;
    }
    if (far)
      questions.push_back(fmt::format("{} is {:.3g} m from the centre of '{}', a body of {:.2g} m: is \"at_m\" the place in the world?",
                                      describe(spec, joint.place, "joint", joint.body, joint.to), nearest, name(body), 2.0 * of));
  }
  for (const CordSpec& cord : spec.cords)
    for (const bool from : {true, false}) {
      const int body = from ? cord.body : cord.to;
      if (body < 0) continue;
      double radius = 0.0;
      const double distance = calc_distance(body, from ? cord.from_m : cord.to_m, radius);
      if (distance > 1.01 * radius)
        questions.push_back(fmt::format("{} is tied {:.3g} m from the centre of '{}', outside of it: is that the place in the world?",
                                        describe(spec, cord.place, "cord", cord.body, cord.to), distance, name(body)));
    }
  return questions;
}

}  // namespace carillon::physics
