#include "runtime/physics/sounding.hpp"

#include <algorithm>
#include <cmath>

#include "runtime/base/chance.hpp"

namespace carillon::physics {
namespace {

constexpr double kTimeToleranceS = 1e-8;  // s; shorter than any step, longer than the permitted remainder of a step

void set_motion(const rigid::Solid& solid, const rigid::State& state, const rigid::Placed& placed, drive::Motion& motion) {
  motion.centre_m = state.centre;
  motion.velocity_m_s = solid.fixed ? Vec3{} : state.velocity;
  motion.spin_rad_s = placed.spin;
  motion.rotation = placed.rotation;
  motion.inverse_inertia = placed.inverse_inertia;
}

drive::Hit to_hit(const rigid::Hit& hit) {
  return {.a = hit.a,
          .b = hit.b,
          .where_m = hit.touch.where_m,
          .normal = hit.touch.normal,
          .gap_m = hit.touch.gap_m,
          .curvature_per_m = hit.touch.curvature_a_per_m + hit.touch.curvature_b_per_m,
          .approach_m_s = hit.approach_m_s,
          .restitution = hit.restitution,
          .impulse_n_s = hit.impulse,
          .linked_mass_kg = hit.linked_mass_kg,
          .places = hit.places,
          .triangles = hit.triangles};
}

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
  drive::Strike given{.time_s = strike.time_s, .together_s = strike.together_s};
  for (const rigid::Hit& hit : strike.hits) {
    if (hit.is_cord) continue;
    given.hits.push_back(to_hit(hit));
    copy_motion(hit.a);
    copy_motion(hit.b);
  }
  // Before the impact, which may not have moved all of them.
  for (int k = 0; const int body : strike.bodies) {
    const rigid::State& before = strike.before[k++];
    set_motion(space_.solid(body), before, rigid::place(space_.solid(body), before), scene_.motions[body]);
  }
  scene_.time_s = strike.time_s;
  drive::add_pulses(scene_, given, lasting_, masks_ ? &*masks_ : nullptr, events);
}

void Sounding::note(const rigid::Forces& forces) {
  if (!masks_) return;
  for (const int side : {0, 1}) {
    const int body = side == 0 ? forces.a : forces.b;
    if (body < 0) continue;
    const std::vector<Vec3>& impulses = side == 0 ? forces.on_a : forces.on_b;
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
