// Method: hits of one instant are grouped into spots, strongest first; each spot gives one Hertz pulse on both bodies. Spots that
// share an impact divide the mass in proportion to their impulses.
#include "runtime/physics/sounding.hpp"

#include <algorithm>
#include <cmath>

#include "runtime/base/chance.hpp"
#include "runtime/physics/impact/spring.hpp"

namespace carillon::physics {
namespace {

using rigid::kMinImpactSpeedMS;

constexpr double kMaskedRatio = 0.01;     // relative to the largest impulse of the same instant: -40 dB
constexpr double kTimeToleranceS = 1e-8;  // s; shorter than any step, longer than the permitted remainder of a step

void set_motion(const rigid::Solid& solid, const rigid::State& state, const rigid::Placed& placed, drive::Motion& motion) {
  motion.centre_m = state.centre;
  motion.velocity_m_s = solid.fixed ? Vec3{} : state.velocity;
  motion.spin_rad_s = placed.spin;
  motion.rotation = placed.rotation;
  motion.inverse_inertia = placed.inverse_inertia;
}

double calc_push(const rigid::Hit& hit) { return dot(hit.impulse, hit.touch.normal); }

}  // namespace

Sounding::Sounding(const WorldSpec& spec, const rigid::Space& space, bool masks_hits) : space_(space) {
  if (masks_hits) masks_.emplace(0);
  for (const BodySpec& body : spec.bodies) add_body(body);
  const GroundSpec ground = spec.ground.value_or(GroundSpec{});
  scene_.ground = {.young_modulus_pa = ground.young_modulus_pa,
                   .poisson_ratio = ground.poisson_ratio,
                   .density_kg_m3 = ground.density_kg_m3,
                   .fixed = true};
}

void Sounding::add_body(const BodySpec& body) {
  const rigid::Solid& solid = space_.solid(static_cast<int>(scene_.bodies.size()));
  scene_.bodies.push_back({.name_hash = base::hash_name(body.name),
                           .young_modulus_pa = solid.young_modulus_pa,
                           .poisson_ratio = solid.poisson_ratio,
                           .density_kg_m3 = body.bank->material.density_kg_m3,
                           .shape = solid.shape.get(),
                           .size_m = solid.shape->get_size_m(),
                           .fixed = solid.fixed,
                           .mass_kg = solid.mass_kg,
                           .centre_m = solid.centre_m});
  scene_.motions.emplace_back();
  copied_.push_back(-1);
  if (masks_) masks_->resize(static_cast<int>(scene_.bodies.size()));
}

void Sounding::copy_motion(int body) {
  if (body < 0 || copied_[body] == step_) return;
  copied_[body] = step_;
  set_motion(space_.solid(body), space_.state(body), space_.placed(body), scene_.motions[body]);
}

void Sounding::add(const rigid::Strike& strike, std::vector<events::Event>& events) {
  ++step_;
  std::vector<const rigid::Hit*> order;
  for (const rigid::Hit& hit : strike.hits) {
    if (hit.is_cord || !(calc_push(hit) > 0.0)) continue;
    order.push_back(&hit);
    copy_motion(hit.a);
    copy_motion(hit.b);
  }
  // Before the impact, which may not have moved all of them.
  for (int k = 0; const int body : strike.bodies) {
    const rigid::State& before = strike.before[k++];
    set_motion(space_.solid(body), before, rigid::place(space_.solid(body), before), scene_.motions[body]);
  }
  scene_.time_s = strike.time_s;
  std::stable_sort(order.begin(), order.end(),
                   [](const auto* x, const auto* y) { return dot(x->impulse, x->impulse) > dot(y->impulse, y->impulse); });
  const double audible_n_s = order.empty() ? 0.0 : kMaskedRatio * norm(order.front()->impulse);
  for (auto rest = order.begin(); rest != order.end();) {
    const rigid::Hit& first = **rest;
    const auto end = std::stable_partition(rest, order.end(), [&](const rigid::Hit* hit) {
      return hit->a == first.a && hit->b == first.b &&
             norm(hit->touch.where_m - first.touch.where_m) <= scene_.calc_spot_radius(hit->a, hit->b);
    });
    add_spot({&*rest, static_cast<std::size_t>(end - rest)}, strike, audible_n_s, events);
    rest = end;
  }
}

void Sounding::add_spot(std::span<const rigid::Hit* const> hits, const rigid::Strike& strike, double audible_n_s,
                        std::vector<events::Event>& events) {
  const rigid::Hit& first = *hits.front();
  Vec3 impulse{}, where{}, normal{};
  double push = 0.0, approach = 0.0, curvature = 0.0, wait_s = strike.together_s;
  for (const rigid::Hit* hit : hits) {
    const double share = calc_push(*hit);
    impulse = impulse + hit->impulse;
    where = where + share * hit->touch.where_m;
    normal = normal + share * hit->touch.normal;
    curvature += share * (hit->touch.curvature_a_per_m + hit->touch.curvature_b_per_m);
    approach = std::max(approach, hit->approach_m_s);
    wait_s = std::min(wait_s, hit->approach_m_s > kMinImpactSpeedMS ? hit->touch.gap_m / hit->approach_m_s : 0.0);
    push += share;
  }
  where = (1.0 / push) * where;
  normal = (1.0 / norm(normal)) * normal;
  const double inverse_mass =
      first.linked_mass_kg > 0.0 ? 1.0 / first.linked_mass_kg : scene_.calc_inverse_mass(scene_.motions, first.a, first.b, where, normal);
  // A resting spot hardly moved by the impact elsewhere, or negligible next to other pulses of the same instant.
  if (!(inverse_mass > 0.0) || push * inverse_mass < 0.2 * kMinImpactSpeedMS || push < audible_n_s) return;
  const double speed = approach > kMinImpactSpeedMS ? approach : push * inverse_mass;
  const double mass = std::min(push / ((1.0 + first.restitution) * speed), 1.0 / inverse_mass);
  lasting_.note_impact(scene_, first.a, first.b, where, strike.time_s);
  const double touch_s = strike.time_s + std::clamp(wait_s, -rigid::kSimultaneousS, strike.together_s);
  drive::Blow blow{.a = first.a, .b = first.b, .touch_s = touch_s, .masked_s = strike.time_s, .impulse_n_s = norm(impulse)};
  blow.duration_s = impact::calc_hertz_duration(scene_.calc_compliance(first.a, first.b),
                                                scene_.calc_contact_radius(first.a, first.b, curvature / push), mass, speed);
  for (const int side : {0, 1}) {
    const int body = side == 0 ? first.a : first.b;
    if (body < 0) continue;
    const double sign = side == 0 ? 1.0 : -1.0;
    // The position of a single hit is known; several hits are on the same face or near it.
    const std::optional<geometry::Place>& known = first.places[side];
    blow.places[side] = known && hits.size() == 1 ? *known : scene_.find_place(body, where, (-sign) * normal, first.triangles[side]);
    blow.impulses_n_s[side] = transpose(scene_.motions[body].rotation) * (sign * impulse);
  }
  const auto add = [&](double share, double duration_s) {
    drive::Blow part = blow;
    part.impulse_n_s *= share;
    for (Vec3& impulse : part.impulses_n_s) impulse = share * impulse;
    part.duration_s = duration_s;
    (void)drive::add_pulses(scene_, part, masks_ ? &*masks_ : nullptr, events);
  };
  add(strike.first_share, blow.duration_s);
  if (strike.first_share < 1.0) add(1.0 - strike.first_share, strike.prolong(blow.duration_s));
}

void Sounding::add(const rigid::Forces& forces, std::vector<events::Event>& events) {
  for (const int side : {0, 1}) {
    const int body = side == 0 ? forces.a : forces.b;
    if (body < 0) continue;
    const geometry::Place& place = side == 0 ? forces.place_a : forces.place_b;
    const std::vector<Vec3>& impulses = side == 0 ? forces.on_a : forces.on_b;
    const events::Force first{.time_s = forces.time_s,
                              .step_s = forces.step_s,
                              .body = body,
                              .other = side == 0 ? forces.b : forces.a,
                              .triangle = place.triangle,
                              .continues = forces.continues,
                              .barycentric = place.barycentric};
    events::split_force(first, impulses, [&](const events::Force& force) { events.push_back(force); });
    if (!masks_) continue;
    Vec3 given{};
    for (const Vec3& impulse : impulses) given = given + impulse;
    (void)masks_->take(body, forces.time_s, norm(given), forces.step_s * static_cast<double>(impulses.size()));
  }
}

void Sounding::update(std::vector<events::Event>& events) {
  ++step_;
  scene_.time_s = space_.get_time();
  scene_.before_s = space_.get_window_start();
  loads_.clear();
  space_.list_contacts(contacts_);
  for (const rigid::Contact* c : contacts_) {
    // Groups have steps of different lengths: each counts when its step ends.
    if (!(c->step_s > 0.0) || !c->touching || std::abs(c->until_s - scene_.time_s) > kTimeToleranceS) continue;
    const double push = dot(c->impulse, c->touch.normal) / c->step_s;
    if (!(push > 0.0)) continue;
    copy_motion(c->a);
    copy_motion(c->b);
    loads_.push_back({.a = c->a,
                      .b = c->b,
                      .owner = c->touch.side_a == geometry::Side::plane ? c->b : c->a,
                      .where_m = c->touch.where_m,
                      .normal = c->touch.normal,
                      .push_n = push,
                      .curvature_per_m = c->touch.curvature_a_per_m + c->touch.curvature_b_per_m,
                      .smooth = c->touch.smooth,
                      .feature = c->touch.id});
  }
  const bool is_at_window = space_.is_at_window();
  for (int i = 0; is_at_window && i < std::ssize(scene_.motions); ++i) scene_.motions[i].is_still = space_.is_still(i);
  lasting_.update(scene_, loads_, is_at_window, events);
}

}  // namespace carillon::physics
