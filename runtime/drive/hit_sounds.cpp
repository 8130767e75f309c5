// Method: a Hertz pulse of the reduced mass that explains the engine's impulse; where modes would take more than 2 % of the blow, the
// impact is integrated from the motions before it and scaled to at most the engine's impulse.
// Source: runtime/physics/impact; K. L. Johnson, "Contact mechanics" (1985), eq. 11.24.
#include "runtime/drive/hit_sounds.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "runtime/physics/impact/impact.hpp"
#include "runtime/physics/impact/predict.hpp"
#include "runtime/physics/rigid/limits.hpp"

namespace carillon::drive {
namespace {

constexpr double kQuietRatio = 0.01;       // relative to the strongest hit of the step: -40 dB
constexpr double kModalShare = 0.02;       // of the blow: below, a Hertz pulse suffices
constexpr double kMinElasticShare = 0.01;  // of the blow: least energy of the modes
constexpr double kMinImpactSpeed = 5e-3;   // m/s; slower hits are not integrated
constexpr double kLongestImpactS = 20e-3;  // s
constexpr double kLongestPulses = 50.0;    // an impact lasts at most this many Hertz times, for the sake of its cost
constexpr double kRubbedRatio = 0.02;      // of the impulse: below, without friction

/// Energy of the modes of a body after a pulse of this length on it [J]; impulse: mesh axes.
double calc_modal_j(const impact::Modes& modes, const std::vector<double>& shape, const Vec3& impulse, double length_s) {
  const std::vector<double>& omega = modes.get_omega();
  double sum = 0.0;
  for (std::size_t i = 0; i < omega.size(); ++i) {
    const double given = shape[3 * i] * impulse[0] + shape[3 * i + 1] * impulse[1] + shape[3 * i + 2] * impulse[2];
    sum += 0.5 * given * given * impact::calc_pulse_spectrum(omega[i] * length_s);
  }
  return sum;
}

std::vector<double> turn_shape(const Mat3& rotation, const std::vector<double>& shape) {
  std::vector<double> turned(shape.size());
  for (std::size_t i = 0; i + 2 < shape.size(); i += 3) {
    const Vec3 x = rotation * Vec3{shape[i], shape[i + 1], shape[i + 2]};
    std::copy(x.begin(), x.end(), turned.begin() + static_cast<std::ptrdiff_t>(i));
  }
  return turned;
}

}  // namespace

double HitSounds::Contact::calc_lost_j() const {
  return 0.5 * mass_kg * speed_m_s * speed_m_s * std::max(kMinElasticShare, 1.0 - restitution * restitution);
}

HitSounds::Contact HitSounds::make_contact(const StepView& step, const FinishedHit& hit) {
  Contact c{.hit = hit};
  c.speed_m_s = std::max(hit.approach_m_s, rigid::kMinImpactSpeedMS);
  c.restitution = std::clamp(hit.parting_m_s / c.speed_m_s, 0.0, 1.0);
  c.mass_kg = hit.push_n_s / ((1.0 + c.restitution) * c.speed_m_s);
  if (c.mass_kg * hit.inverse_mass > 1.0) {  // the impulse came from elsewhere, or from several points
    c.mass_kg = 1.0 / hit.inverse_mass;
    c.speed_m_s = hit.push_n_s * hit.inverse_mass / (1.0 + c.restitution);
  }
  double curvature = hit.curvature_per_m;
  if (!(curvature >= 0.0)) curvature = calc_curvatures(step, hit.a, hit.b, hit.stations_m, hit.outwards).calc_sum();
  c.compliance = step.scene.calc_compliance(hit.a, hit.b);
  c.radius_m = step.scene.calc_contact_radius(hit.a, hit.b, curvature);
  for (const std::size_t side : {0, 1}) {
    const int body = side == 0 ? hit.a : hit.b;
    if (body < 0 || !step.bodies[body].shape) continue;
    const TouchBody& b = step.bodies[body];
    c.places[side] = b.shape->find_place(hit.stations_m[side], hit.outwards[side]);
    if (b.modes) c.shapes[side] = bank::calc_shapes(*b.given.bank, c.places[side].triangle, c.places[side].barycentric);
  }
  return c;
}

void HitSounds::add(const StepView& step, std::vector<FinishedHit>& hits, LastingContacts& lasting, TouchesCounters& counters,
                    std::vector<events::Event>& events) {
  const auto name = [&](int body) { return step.scene.get_matter(body).name_hash; };
  std::stable_sort(hits.begin(), hits.end(), [&](const FinishedHit& x, const FinishedHit& y) {
    if (x.push_n_s != y.push_n_s) return x.push_n_s > y.push_n_s;
    if (x.touch_s != y.touch_s) return x.touch_s < y.touch_s;
    return std::pair(name(x.a), name(x.b)) < std::pair(name(y.a), name(y.b));
  });
  impacts_left_ = step.options.max_impacts;
  for (const FinishedHit& hit : hits) {
    const Vec3 where = step.place(step.scene.motions, hit.a, hit.stations_m[0]);
    lasting.note_impact(step.scene, hit.a, hit.b, where, step.scene.time_s);
    const bool is_felt = hit.push_n_s * hit.inverse_mass >= 0.2 * rigid::kMinImpactSpeedMS;
    if (is_felt && hit.push_n_s >= kQuietRatio * hits.front().push_n_s && sound(step, hit, counters, events))
      ++counters.hits;
    else
      ++counters.masked;
  }
}

/// False if masked.
bool HitSounds::sound(const StepView& step, const FinishedHit& hit, TouchesCounters& counters, std::vector<events::Event>& events) {
  const Contact c = make_contact(step, hit);
  Blow blow{.a = hit.a, .b = hit.b, .touch_s = hit.touch_s, .masked_s = hit.touch_s, .places = c.places};
  blow.duration_s = impact::calc_hertz_duration(c.compliance, c.radius_m, c.mass_kg, c.speed_m_s);
  blow.impulses_n_s = hit.impulses_n_s;
  blow.impulse_n_s = norm(hit.impulses_n_s[0]);
  double modal_j = 0.0;
  for (const std::size_t side : {0, 1})
    if (!c.shapes[side].empty())
      modal_j += calc_modal_j(*step.bodies[side == 0 ? hit.a : hit.b].modes, c.shapes[side], hit.impulses_n_s[side], blow.duration_s);
  const double blow_j = 0.5 * c.mass_kg * c.speed_m_s * c.speed_m_s, elastic = 2.0 * c.mass_kg * c.speed_m_s / hit.push_n_s;
  if (modal_j * elastic * elastic > kModalShare * blow_j && c.speed_m_s > kMinImpactSpeed) {
    if (impacts_left_ <= 0) {
      ++counters.simplified;
    } else if (integrate(step, c, counters, events)) {
      for (const int body : {hit.a, hit.b})
        if (body >= 0) (void)masks_.take(body, hit.touch_s, blow.impulse_n_s, blow.duration_s);
      return true;
    }
  }
  if (const double most_j = c.calc_lost_j(); modal_j > most_j) {
    ++counters.limited;
    const double scale = std::sqrt(most_j / modal_j);
    for (Vec3& impulse : blow.impulses_n_s) impulse = scale * impulse;
    blow.impulse_n_s *= scale;
  }
  return add_pulses(step.scene, blow, &masks_, events) > 0;
}

/// False if it cannot be integrated: nothing is appended.
bool HitSounds::integrate(const StepView& step, const Contact& c, TouchesCounters& counters, std::vector<events::Event>& events) {
  const FinishedHit& hit = c.hit;
  if (!(hit.approach_m_s > rigid::kMinImpactSpeedMS)) return false;
  --impacts_left_;
  std::vector<impact::Body> bodies;
  std::array<std::vector<double>, 2> shapes;
  impact::Contact contact;
  contact.where_m = hit.before[0].centre_m + hit.before[0].rotation * (hit.stations_m[0] - step.scene.bodies[hit.a].centre_m);
  contact.normal = hit.normal;
  contact.spring.stiffness = impact::calc_hertz_stiffness(c.compliance, c.radius_m);
  contact.restitution = step.calc_restitution(hit.a, hit.b);
  contact.is_limit = true;
  contact.friction = hit.rubbed_n_s > kRubbedRatio * hit.push_n_s ? step.calc_friction(hit.a, hit.b) : 0.0;
  for (const std::size_t side : {0, 1}) {
    const int index = side == 0 ? hit.a : hit.b;
    if (index < 0) continue;
    const TouchBody& given = step.bodies[index];
    const Motion& before = hit.before[side];
    impact::Body body;
    body.centre_m = before.centre_m;
    if (step.moves(index)) {
      body.mass_kg = step.scene.bodies[index].mass_kg;
      body.inertia_kg_m2 = before.rotation * (given.inertia * transpose(before.rotation));
    }
    body.velocity_m_s = before.velocity_m_s;
    body.spin_rad_s = before.spin_rad_s;
    if (!c.shapes[side].empty()) {
      body.modes = given.modes.get();
      shapes[side] = turn_shape(before.rotation, c.shapes[side]);
    }
    (side == 0 ? contact.a : contact.b) = static_cast<int>(bodies.size());
    bodies.push_back(body);
  }
  contact.shape_a = shapes[0];
  contact.shape_b = shapes[1];
  std::vector<impact::Pulse> pulses;
  double modal_j = 0.0;
  try {
    impact::Impact impact(bodies, {contact});
    if (!(impact.calc_approach(0) > rigid::kMinImpactSpeedMS)) return false;
    const double hertz_s = impact::calc_hertz_duration(c.compliance, c.radius_m, c.mass_kg, c.speed_m_s);
    (void)impact.advance(std::min(kLongestImpactS, kLongestPulses * hertz_s));
    pulses = impact.take_pulses();
    const impact::Books books = impact.get_books();
    modal_j = books.modal + books.dissipated_modes + books.above_band;
  } catch (const std::invalid_argument&) {
    return false;
  }
  double push = 0.0;
  for (const impact::Pulse& pulse : pulses)
    for (const Vec3& impulse : pulse.impulse_n_s) push += dot(impulse, hit.normal);
  if (!(push > 0.0)) return false;
  double scale = std::min(1.0, hit.push_n_s / push);
  if (const double most_j = c.calc_lost_j(); modal_j * scale * scale > most_j) {
    ++counters.limited;
    scale = std::sqrt(most_j / modal_j);
  }
  ++counters.impacts;
  for (const std::size_t side : {0, 1}) {
    const int body = side == 0 ? hit.a : hit.b;
    if (body < 0 || step.scene.bodies[body].shape == nullptr) continue;
    const double sign = side == 0 ? scale : -scale;
    for (const impact::Pulse& pulse : pulses) {
      events::Force first{.time_s = hit.touch_s + pulse.start_s, .step_s = pulse.step_s, .body = body};
      first.other = side == 0 ? hit.b : hit.a;
      first.triangle = c.places[side].triangle;
      first.barycentric = c.places[side].barycentric;
      first.continues = &pulse != pulses.data();
      std::vector<Vec3> impulses;
      for (const Vec3& impulse : pulse.impulse_n_s) impulses.push_back(turn_back(hit.before[side].rotation, sign * impulse));
      events::split_force(first, impulses, [&](const events::Force& force) { events.push_back(force); });
    }
  }
  return true;
}

}  // namespace carillon::drive
