// Method: the real contact lasts one Hertz time from the touch, so its pulse is centred half that time later. If several spots share an
// impact, each carries its share of the mass.
// Source: J. O'Brien, C. Shen, C. Gatchalian, "Synthesizing sounds from rigid-body simulations" (2002), section 4.
#include "runtime/drive/pulses.hpp"

#include <algorithm>
#include <cmath>

#include "runtime/physics/impact/spring.hpp"
#include "runtime/physics/rigid/limits.hpp"

namespace carillon::drive {
namespace {

using rigid::kMinImpactSpeedMS;

constexpr double kMaskedRatio = 0.01;        // relative to the largest impulse of the same instant: -40 dB
constexpr double kForwardMaskRatio = 0.005;  // relative to an earlier impulse of the same body: -46 dB
constexpr double kMaskDecayS = 0.05;         // s; decay time (1/e) of the latter threshold

void add_spot(const Scene& scene, const Strike& strike, const std::vector<const Hit*>& hits, double touch_s, double max_push,
              LastingContacts& lasting, Masks* masks, std::vector<events::Event>& events) {
  const Hit& first = *hits.front();
  Vec3 impulse{}, where{}, normal{};
  double push = 0.0, approach = 0.0, curvature = 0.0;
  for (const Hit* hit : hits) {
    const double share = dot(hit->impulse_n_s, hit->normal);
    impulse = impulse + hit->impulse_n_s;
    where = where + share * hit->where_m;
    normal = normal + share * hit->normal;
    curvature += share * hit->curvature_per_m;
    approach = std::max(approach, hit->approach_m_s);
    push += share;
  }
  where = (1.0 / push) * where;
  normal = (1.0 / norm(normal)) * normal;
  const double inverse_mass =
      first.linked_mass_kg > 0.0 ? 1.0 / first.linked_mass_kg : scene.calc_inverse_mass(first.a, first.b, where, normal);
  // A resting spot hardly moved by the impact elsewhere, or negligible next to other pulses of the same instant.
  if (!(inverse_mass > 0.0) || push * inverse_mass < 0.2 * kMinImpactSpeedMS || push < kMaskedRatio * max_push) return;
  const double speed = approach > kMinImpactSpeedMS ? approach : push * inverse_mass;
  const double mass = std::min(push / ((1.0 + first.restitution) * speed), 1.0 / inverse_mass);
  lasting.note_impact(scene, first.a, first.b, where, strike.time_s);
  Blow blow{.a = first.a, .b = first.b, .touch_s = touch_s, .masked_s = strike.time_s, .impulse_n_s = norm(impulse)};
  blow.duration_s = impact::calc_hertz_duration(scene.calc_compliance(first.a, first.b),
                                                scene.calc_contact_radius(first.a, first.b, curvature / push), mass, speed);
  for (const int side : {0, 1}) {
    const int body = side == 0 ? first.a : first.b;
    if (body < 0) continue;
    const double sign = side == 0 ? 1.0 : -1.0;
    // The position of a single hit is known; several hits are on the same face or near it.
    const std::optional<geometry::Place>& known = first.places[side];
    blow.places[side] = known && hits.size() == 1 ? *known : scene.find_place(body, where, (-sign) * normal, first.triangles[side]);
    blow.impulses_n_s[side] = transpose(scene.motions[body].rotation) * (sign * impulse);
  }
  add_pulses(scene, blow, masks, events);
}

}  // namespace

bool Masks::take(int body, double time_s, double impulse_n_s, double duration_s) {
  Mask& mask = masks_[body];
  mask.impulse_n_s *= std::exp(-std::max(time_s - mask.time_s, 0.0) / kMaskDecayS);
  mask.time_s = std::max(time_s, mask.time_s);
  if (impulse_n_s < kForwardMaskRatio * mask.impulse_n_s && duration_s >= mask.duration_s) return true;
  if (impulse_n_s >= mask.impulse_n_s) mask = {impulse_n_s, mask.time_s, duration_s};
  return false;
}

int add_pulses(const Scene& scene, const Blow& blow, Masks* masks, std::vector<events::Event>& events) {
  int count = 0;
  for (const int side : {0, 1}) {
    const int body = side == 0 ? blow.a : blow.b;
    if (body < 0 || scene.bodies[body].shape == nullptr) continue;
    if (masks != nullptr && masks->take(body, blow.masked_s, blow.impulse_n_s, blow.duration_s)) continue;
    events.push_back(events::Impulse{.time_s = blow.touch_s + 0.5 * blow.duration_s,
                                     .body = body,
                                     .other = side == 0 ? blow.b : blow.a,
                                     .triangle = blow.places[side].triangle,
                                     .barycentric = blow.places[side].barycentric,
                                     .impulse_n_s = blow.impulses_n_s[side],
                                     .duration_s = blow.duration_s});
    ++count;
  }
  return count;
}

void add_pulses(const Scene& scene, const Strike& strike, LastingContacts& lasting, Masks* masks, std::vector<events::Event>& events) {
  std::vector<const Hit*> order;
  for (const Hit& hit : strike.hits)
    if (dot(hit.impulse_n_s, hit.normal) > 0.0) order.push_back(&hit);
  std::stable_sort(order.begin(), order.end(),
                   [](const auto* x, const auto* y) { return dot(x->impulse_n_s, x->impulse_n_s) > dot(y->impulse_n_s, y->impulse_n_s); });
  const double max_push = order.empty() ? 0.0 : norm(order.front()->impulse_n_s);
  std::vector<char> taken(order.size(), 0);
  for (std::size_t seed = 0; seed < order.size(); ++seed) {
    if (taken[seed]) continue;
    std::vector<const Hit*> spot;
    double wait_s = strike.together_s;
    for (std::size_t i = seed; i < order.size(); ++i) {
      const Hit& hit = *order[i];
      if (taken[i] || hit.a != order[seed]->a || hit.b != order[seed]->b) continue;
      if (norm(hit.where_m - order[seed]->where_m) > scene.calc_spot_radius(hit.a, hit.b)) continue;
      taken[i] = 1;
      spot.push_back(&hit);
      wait_s = std::min(wait_s, hit.approach_m_s > kMinImpactSpeedMS ? hit.gap_m / hit.approach_m_s : 0.0);
    }
    add_spot(scene, strike, spot, strike.time_s + std::clamp(wait_s, -rigid::kSimultaneousS, strike.together_s), max_push, lasting, masks,
             events);
  }
}

}  // namespace carillon::drive
