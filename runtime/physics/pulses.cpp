// Method: the real contact lasts one Hertz time from the touch, so its pulse is centred half that time later. If several spots share an
// impact, each carries its share of the mass.
// Source: J. O'Brien, C. Shen, C. Gatchalian, "Synthesizing sounds from rigid-body simulations" (2002), section 4.
#include "runtime/physics/pulses.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include "runtime/physics/rigid/limits.hpp"

namespace carillon::physics {
namespace {

using rigid::kMinImpactSpeedMS;

constexpr double kMaskedRatio = 0.01;        // relative to the largest impulse of the same instant: -40 dB
constexpr double kForwardMaskRatio = 0.005;  // relative to an earlier impulse of the same body: -46 dB
constexpr double kMaskDecayS = 0.05;         // s; decay time (1/e) of the latter threshold

/// State of a body before an impact, which may not have moved it.
const rigid::State& get_state_before(const rigid::Space& space, const rigid::Strike& strike, int body) {
  const auto at = std::find(strike.bodies.begin(), strike.bodies.end(), body);
  return at == strike.bodies.end() ? space.state(body) : strike.before[at - strike.bodies.begin()];
}

/// 1/m_eff of the contact along the normal [1/kg], in the state before the impact.
double calc_inverse_mass(const rigid::Space& space, const rigid::Strike& strike, const rigid::Hit& hit, const Vec3& where,
                         const Vec3& normal) {
  double sum = 0.0;
  for (const int body : {hit.a, hit.b}) {
    if (body < 0 || space.solid(body).fixed) continue;
    const rigid::State& state = get_state_before(space, strike, body);
    const rigid::Solid& solid = space.solid(body);
    const Vec3 arm = cross(where - state.centre, normal);
    sum += 1.0 / solid.mass_kg + dot(arm, rigid::place(solid, state).inverse_inertia * arm);
  }
  return sum;
}

void add_spot(const rigid::Space& space, const rigid::Strike& strike, const std::vector<const rigid::Hit*>& hits, double touch_s,
              double max_push, LastingContacts& lasting, Masks* masks, std::vector<events::Event>& events) {
  const rigid::Hit& first = *hits.front();
  Vec3 impulse{}, where{}, normal{};
  double push = 0.0, approach = 0.0, curvature = 0.0;
  for (const rigid::Hit* hit : hits) {
    const double share = dot(hit->impulse, hit->touch.normal);
    impulse = impulse + hit->impulse;
    where = where + share * hit->touch.where_m;
    normal = normal + share * hit->touch.normal;
    curvature += share * (hit->touch.curvature_a_per_m + hit->touch.curvature_b_per_m);
    approach = std::max(approach, hit->approach_m_s);
    push += share;
  }
  where = (1.0 / push) * where;
  normal = (1.0 / norm(normal)) * normal;
  const double inverse_mass =
      first.linked_mass_kg > 0.0 ? 1.0 / first.linked_mass_kg : calc_inverse_mass(space, strike, first, where, normal);
  // A resting spot hardly moved by the impact elsewhere, or negligible next to other pulses of the same instant.
  if (!(inverse_mass > 0.0) || push * inverse_mass < 0.2 * kMinImpactSpeedMS || push < kMaskedRatio * max_push) return;
  const double speed = approach > kMinImpactSpeedMS ? approach : push * inverse_mass;
  const double mass = std::min(push / ((1.0 + first.restitution) * speed), 1.0 / inverse_mass);
  lasting.note_impact(space, first.a, first.b, where, strike.time_s);
  rigid::Hit mean = first;
  mean.touch.curvature_a_per_m = curvature / push;
  mean.touch.curvature_b_per_m = 0.0;
  events::Impulse pulse;
  pulse.duration_s = space.calc_contact_time(mean, mass, speed);
  pulse.time_s = touch_s + 0.5 * pulse.duration_s;
  for (const int side : {0, 1}) {
    const int body = side == 0 ? first.a : first.b;
    if (body < 0 || (masks != nullptr && masks->take(body, strike.time_s, norm(impulse), pulse.duration_s))) continue;
    const rigid::State& state = get_state_before(space, strike, body);
    const double sign = side == 0 ? 1.0 : -1.0;
    // The position of a single hit is known; several hits are on the same face or near it.
    const std::optional<geometry::Place>& known = first.places[side];
    const std::int32_t near = first.triangles[side];
    const Spotted place = known && hits.size() == 1 ? Spotted{known->triangle, known->barycentric}
                                                    : find_place(space.solid(body), state, where, (-sign) * normal, near);
    pulse.body = body;
    pulse.other = side == 0 ? first.b : first.a;
    pulse.triangle = place.triangle;
    pulse.barycentric = place.barycentric;
    pulse.impulse_n_s = transpose(rigid::make_rotation(state.rotation)) * (sign * impulse);
    events.push_back(pulse);
  }
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

void add_pulses(const rigid::Space& space, const rigid::Strike& strike, LastingContacts& lasting, Masks* masks,
                std::vector<events::Event>& events) {
  std::vector<const rigid::Hit*> order;
  for (const rigid::Hit& hit : strike.hits)
    if (!hit.is_cord && dot(hit.impulse, hit.touch.normal) > 0.0) order.push_back(&hit);
  std::stable_sort(order.begin(), order.end(),
                   [](const auto* x, const auto* y) { return dot(x->impulse, x->impulse) > dot(y->impulse, y->impulse); });
  const double max_push = order.empty() ? 0.0 : norm(order.front()->impulse);
  std::vector<char> taken(order.size(), 0);
  for (std::size_t seed = 0; seed < order.size(); ++seed) {
    if (taken[seed]) continue;
    std::vector<const rigid::Hit*> spot;
    double wait_s = strike.together_s;
    for (std::size_t i = seed; i < order.size(); ++i) {
      const rigid::Hit& hit = *order[i];
      if (taken[i] || hit.a != order[seed]->a || hit.b != order[seed]->b) continue;
      if (norm(hit.touch.where_m - order[seed]->touch.where_m) > calc_spot_radius(space, hit.a, hit.b)) continue;
      taken[i] = 1;
      spot.push_back(&hit);
      wait_s = std::min(wait_s, hit.approach_m_s > kMinImpactSpeedMS ? hit.touch.gap_m / hit.approach_m_s : 0.0);
    }
    add_spot(space, strike, spot, strike.time_s + std::clamp(wait_s, -rigid::kSimultaneousS, strike.together_s), max_push, lasting, masks,
             events);
  }
}

}  // namespace carillon::physics
