// Bodies, joints and cords of a world's description as those of the rigid-body simulation.
#include "runtime/physics/make_space.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <stdexcept>
#include <utility>

#include "runtime/bank/surface.hpp"
#include "runtime/base/error.hpp"
#include "runtime/physics/check.hpp"

namespace carillon::physics {
namespace {

constexpr double kSoftSpeedMS = 300.0;  // m/s; sound in bars of soft materials, such as rubber, is slower
constexpr double kMaxBendRatio = 0.25;  // of the thickness: deflection by a blow that is still integrated with the modes

/// Stops of a joint: one at each end of its travel.
void add_stops(const JointSpec& j, const std::vector<rigid::Solid>& solids, const std::vector<rigid::State>& states, rigid::Links& links) {
  const bool turned = solids[j.body].fixed;  // the moving body comes first
  const int a = turned ? j.to : j.body, b = turned ? j.body : j.to;
  const auto get_turn = [&](int body) {
    return body < 0 ? Mat3{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}} : transpose(rigid::make_rotation(states[body].rotation));
  };
  const auto get_place = [&](int body) { return body < 0 ? j.at_m : get_turn(body) * (j.at_m - states[body].centre); };
  const Vec3 lever = find_across(j.axis);
  double arm = solids[a].radius_m;
  if (b >= 0 && !solids[b].fixed) arm = std::min(arm, solids[b].radius_m);
  for (const bool is_lower : {true, false}) {
    rigid::Stop stop{.turns = j.kind == joints::Kind::kHinge, .at_a = get_place(a), .at_b = get_place(b), .axis = get_turn(b) * j.axis};
    stop.lever_a = get_turn(a) * lever;
    stop.lever_b = get_turn(b) * lever;
    stop.arm_m = arm;
    stop.is_lower = is_lower;
    stop.max = turned ? -(*j.limits)[is_lower ? 1 : 0] : (*j.limits)[is_lower ? 0 : 1];
    links.cords.push_back({.a = a, .b = b, .restitution = j.stop_restitution, .stop = stop});
  }
}

rigid::Links make_links(const WorldSpec& spec, const std::vector<rigid::Solid>& solids, const std::vector<rigid::State>& states) {
  rigid::Links links;
  for (const JointSpec& j : spec.joints) {
    links.joints.push_back({j.kind, j.body, j.to, j.at_m, j.axis, j.second_axis, j.damping});
    if (j.limits) add_stops(j, solids, states, links);
  }
  for (const CordSpec& c : spec.cords) {
    const auto tie = [&](int body, const Vec3& where) {
      if (body < 0) return where;
      const rigid::State& state = states[body];
      return transpose(rigid::make_rotation(state.rotation)) * (where - state.centre);
    };
    rigid::Cord cord;
    // The moving body comes first.
    const bool turned = solids[c.body].fixed;
    cord.a = turned ? c.to : c.body;
    cord.b = turned ? c.body : c.to;
    cord.at_a = tie(cord.a, turned ? c.to_m : c.from_m);
    cord.at_b = tie(cord.b, turned ? c.from_m : c.to_m);
    cord.length_m = std::max(c.length_m.value_or(0.0), calc_length(c.from_m - c.to_m));
    cord.restitution = c.restitution;
    links.cords.push_back(cord);
  }
  return links;
}

}  // namespace

rigid::Solid SolidMaker::make(const BodySpec& b) {
  rigid::Solid solid;
  auto& shared = shapes_[b.bank];
  if (!shared) {
    try {
      shared = std::make_shared<geometry::Shape>(b.bank->vertices_m, b.bank->triangles);
    } catch (const InputError& e) {
      throw InputError(fmt::format("body '{}': {}", b.name, e.what()));
    }
  }
  solid.shape = shared;
  solid.fixed = b.fixed;
  solid.mass_kg = b.bank->rigid.mass_kg;
  solid.centre_m = b.bank->rigid.centre_m;
  if (!b.fixed) {
    solid.inertia_kg_m2 = make_matrix(b.bank->rigid.inertia_kg_m2);
    solid.inverse_inertia = calc_inverse(solid.inertia_kg_m2);
  }
  for (const Vec3& v : b.bank->vertices_m) solid.radius_m = std::max(solid.radius_m, calc_length(v - solid.centre_m));
  solid.restitution = b.restitution;
  solid.friction = b.friction;
  solid.rolling_resistance = b.rolling_resistance;
  solid.young_modulus_pa = b.bank->material.young_modulus_pa;
  solid.poisson_ratio = b.bank->material.poisson_ratio;
  if (has_modes_) solid.modes = modes_.find(*b.bank);
  if (solid.modes) {
    solid.find_shape = [bank = b.bank](const geometry::Place& place) {
      return bank::calc_shapes(*bank, place.triangle, place.barycentric);
    };
    const bank::Material& material = b.bank->material;
    const double thickness_m = bank::calc_thickness_m(b.bank->vertices_m, b.bank->triangles, b.bank->rigid.volume_m3);
    if (material.young_modulus_pa < kSoftSpeedMS * kSoftSpeedMS * material.density_kg_m3 && thickness_m > 0.0)
      solid.max_bend_m = kMaxBendRatio * thickness_m;
  }
  return solid;
}

rigid::State make_state(const BodySpec& b, const rigid::Solid& solid) {
  rigid::State state;
  state.rotation = rigid::normalise(b.initial.rotation);
  const Mat3 rotation = rigid::make_rotation(state.rotation);
  state.centre = b.initial.position_m + rotation * solid.centre_m;
  state.velocity = b.velocity_m_s;
  if (!b.fixed) state.momentum = rotation * (solid.inertia_kg_m2 * (transpose(rotation) * b.angular_velocity_rad_s));
  return state;
}

void check_start(const WorldSpec& spec, const rigid::Space& space) {
  for (std::size_t i = 0; i < spec.bodies.size() && !spec.joints.empty(); ++i) {
    const BodySpec& body = spec.bodies[i];
    const double error = space.get_start_error(static_cast<int>(i));
    if (body.fixed || (body.velocity_m_s == Vec3{} && body.angular_velocity_rad_s == Vec3{})) continue;
    double fastest = 0.0;
    for (const BodySpec& other : spec.bodies) fastest = std::max(fastest, calc_length(other.velocity_m_s));
    if (error > 1e-3 + 0.01 * fastest)
      throw InputError(fmt::format(
          "body '{}': its start velocities differ by {:.3g} m/s from those that its joints allow; a body that rotates about a joint has "
          "\"velocity_m_s\" = \"angular_velocity_rad_s\" x (its centre of mass - the joint), and bodies attached to it move along",
          body.name, error));
  }
}

rigid::Space make_space(const WorldSpec& spec, const WorldOptions& options, SolidMaker& maker) {
  check(spec, options);
  std::vector<rigid::Solid> solids;
  std::vector<rigid::State> states;
  for (const BodySpec& body : spec.bodies) {
    solids.push_back(maker.make(body));
    states.push_back(make_state(body, solids.back()));
  }
  std::optional<rigid::Ground> ground;
  if (spec.ground)
    ground = {spec.ground->height_m,         spec.ground->restitution,   spec.ground->friction,
              spec.ground->young_modulus_pa, spec.ground->poisson_ratio, spec.ground->rolling_resistance};
  const rigid::Links links = make_links(spec, solids, states);
  try {
    return rigid::Space(std::move(solids), std::move(states), ground, spec.gravity_m_s2,
                        {.step_s = options.contact_step_s, .islands = options.islands, .joint_tolerance = options.joint_tolerance}, links);
  } catch (const std::invalid_argument& error) {  // joints that do not form trees
    throw InputError(error.what());
  }
}

}  // namespace carillon::physics
