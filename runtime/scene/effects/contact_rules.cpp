// Source:     the equations of each rule in docs/effects.md.
#include "runtime/scene/effects/contact_rules.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <span>
#include <vector>

#include "runtime/synth/contact_forces.hpp"

namespace carillon::effects {
namespace {

using Rule = SelectionReason::Rule;
constexpr double kRingS = 0.05;        // interval at which the driven ring is updated
constexpr double kDrivenHoldS = 0.25;  // audible time after a record of a moving contact

/// Surfaces of a contact with their moduli: of the body of the record, and of the other one.
std::array<synth::ContactSurface, 2> find_surfaces(const SceneFacts& facts, const events::LastingContact& contact) {
  const bool has_other = contact.other >= 0 && contact.other < std::ssize(facts.bodies);
  const auto complete = [](const BodyFacts& body) {
    const bank::Material& m = body.bank->material;
    return synth::complete(body.surface, m.young_modulus_pa / (1.0 - m.poisson_ratio * m.poisson_ratio), bank::calc_wave_impedance(m));
  };
  const synth::ContactSurface own = complete(facts.bodies[contact.body]);
  synth::ContactSurface other = facts.ground;
  if (has_other) other = complete(facts.bodies[contact.other]);
  return {own, other};
}

/// Growth rate of the mean square velocity of each mode under a lasting contact: a quarter of the density of its force.
std::vector<double> calc_power(const SelectedBody& body, const events::LastingContact& contact, Hearing& hearing) {
  const std::span<const BankLevels::Mode> modes = body.bank->get_modes();
  std::vector<double> power(modes.size(), 0.0);
  const auto [own, other] = find_surfaces(hearing.facts, contact);
  const synth::ContactNoise noise = synth::calc_contact_noise(contact, own, other, hearing.facts.rate_hz);
  if (!(noise.decay_length_m > 0.0)) return power;
  const double drag = noise.sliding * std::sqrt(own.friction * other.friction), slip = norm(contact.slip_m_s);
  Vec3 along = contact.normal;
  for (std::size_t k = 0; k < 3 && slip > 0.0; ++k) along[k] -= drag / slip * contact.slip_m_s[k];
  if (!body.bank->calc_projections(contact.triangle, contact.barycentric, along, hearing.projection)) return power;
  for (std::size_t m = 0; m < modes.size(); ++m)
    power[m] = 0.25 * synth::calc_density(noise, contact.force_n, modes[m].freq_hz) * hearing.projection[m] * hearing.projection[m];
  return power;
}

/// Ring of the modes driven by a contact, up to this record; every kRingS, and when the contact rests or ends. Returns the end of its
/// audible sound at the body.
double ring(SelectedBody& body, const events::LastingContact& contact, Hearing& hearing) {
  const double speed_m_s = std::max({contact.sweep_m_s, contact.other_sweep_m_s, norm(contact.slip_m_s)});
  const double size = contact.force_n * speed_m_s;
  const bool drives = contact.state != events::ContactState::kEnd && contact.force_n > 0.0 && speed_m_s > kCreepMs;
  auto driving = std::find_if(body.driving.begin(), body.driving.end(), [&](const auto& one) { return one.id == contact.id; });
  if (driving == body.driving.end()) {
    if (drives) body.driving.push_back({contact.id, contact.time_s, size, contact, contact});
    return kNever;
  }
  if (drives && size > driving->size) {
    driving->size = size;
    driving->strongest = contact;
  }
  driving->last = contact;
  const double gap_s = contact.time_s - driving->since_s;
  if (drives && gap_s < kRingS) return kNever;
  const std::vector<double> power = calc_power(body, driving->strongest, hearing);
  if (drives)
    *driving = {contact.id, contact.time_s, size, contact, contact};
  else
    body.driving.erase(driving);

  const std::span<const BankLevels::Mode> modes = body.bank->get_modes();
  const double distance = hearing.find_ways(body.position_m, contact.time_s), passed_s = std::max(0.0, contact.time_s - body.ring_at_s);
  body.ring_at_s = std::max(body.ring_at_s, contact.time_s);
  body.ring_m2_s2.resize(modes.size());
  double steady_pa2 = 0.0;
  for (std::size_t m = 0; m < modes.size(); ++m) {
    const double d = modes[m].decay_per_s;
    double& ring = body.ring_m2_s2[m];
    ring = ring * std::exp(-2.0 * d * passed_s) - power[m] * std::expm1(-2.0 * d * gap_s) / (2.0 * d);
    steady_pa2 += ring * std::pow(modes[m].gain_pa * modes[m].weight / distance, 2.0);
  }
  hearing.loudest_pa2_s = std::max(hearing.loudest_pa2_s, steady_pa2 * kEarS);
  if (!(hearing.loudest_pa2_s > 0.0)) return kNever;
  const double quiet_pa = hearing.calc_quiet_pa(hearing.calc_inaudible_db(), distance, modes.size());
  std::vector<double> levels(modes.size());
  for (std::size_t m = 0; m < modes.size(); ++m)
    levels[m] = kPeakFactor * std::sqrt(2.0 * body.ring_m2_s2[m]) * modes[m].gain_pa * modes[m].weight / quiet_pa;
  return body.ring_out(contact.time_s, levels);
}

/// Calls of a contact at a time; false for a contact at rest.
bool call_motion(SelectedBody& body, const events::LastingContact& contact, double time_s, Hearing& hearing) {
  const double slip = norm(contact.slip_m_s);
  const double sweep = std::max(contact.sweep_m_s, contact.other_sweep_m_s);
  const bool presses = contact.force_n > 0.0;
  const auto offer = [&](Effect effect, double speed) {
    const bool goes = presses && speed > kCreepMs;
    body.call(effect, goes ? 1.0 + speed : 0.0, {.rule = goes ? Rule::kSlip : Rule::kNoSlip, .value = speed, .limit = kCreepMs});
    return goes;
  };
  // Slip ratio (docs/decisions/contact-sound.md); the rest is rolling.
  const double sliding = sweep > slip ? slip / sweep : 1.0;
  const bool slides = offer(Effect::kRoughness, std::min(slip, sweep)), rolls = offer(Effect::kRolling, sweep * (1.0 - sliding));
  if (slides || rolls) {
    body.call(Effect::kModal, 1.0, {.rule = Rule::kSlip, .value = std::max(slip, sweep), .limit = kCreepMs});
    body.call_directivity(body.bank->get_spread_db());
    body.sounds_until_s = std::max(body.sounds_until_s, time_s + kDrivenHoldS);
    if (body.mean_hz == 0.0) body.mean_hz = 4000.0;  // unknown: the most sensitive frequency of the ear
    body.call_propagation(hearing, time_s);
  }
  return slides || rolls;
}

void call_damping(SelectedBody& body, double share) {
  body.call(Effect::kContactDamping, share, {.rule = Rule::kChange, .value = to_db(share), .limit = to_db(body.audible_share)});
}

}  // namespace

void judge(SelectedBody& body, const events::LastingContact& contact, Hearing& hearing) {
  std::erase_if(body.lasting, [&](const SelectedBody::Lasting& one) { return one.id == contact.id; });
  // Without a strike the contact's ring alone determines the level of the modes.
  if (const double end_s = ring(body, contact, hearing); end_s > contact.time_s) {
    body.call(Effect::kModal, 1.0, {.rule = Rule::kSlip, .value = norm(contact.slip_m_s), .limit = kCreepMs});
    body.call_directivity(body.bank->get_spread_db());
    body.sounds_until_s = std::max(body.sounds_until_s, end_s);
    body.call_propagation(hearing, contact.time_s);
  }
  if (contact.state == events::ContactState::kEnd) return;
  const bool moves = call_motion(body, contact, contact.time_s, hearing);
  if (!body.possible.has(Effect::kContactDamping)) return;
  const auto [own, other] = find_surfaces(hearing.facts, contact);
  const double impedance = synth::find_impedance(contact, other);
  if (!(impedance > 0.0)) return;
  // A dashpot z adds z (phi . n)^2 / 2 to a decay; a relative error e of a decay changes the exposure by e^2 / 2.
  if (!body.bank->calc_projections(contact.triangle, contact.barycentric, contact.normal, hearing.projection)) return;
  double max = 0.0, sounding = 0.0;
  const synth::ContactSpring spring = synth::calc_contact_spring(contact.patch_radius_m, own.modulus_pa, other.modulus_pa);
  const std::span<const BankLevels::Mode> modes = body.bank->get_modes();
  for (std::size_t m = 0; m < modes.size(); ++m) {
    const double taken = 0.5 * impedance * hearing.projection[m] * hearing.projection[m] +
                         synth::calc_spring_loss(spring, 2.0 * std::numbers::pi * modes[m].freq_hz, hearing.projection[m]);
    const double part = taken / modes[m].decay_per_s;
    max = std::max(max, part);
    if (moves || body.quiet_s[m] >= contact.time_s) sounding = std::max(sounding, part);
  }
  const auto calc_share = [](double part) { return std::min(1.0, 0.5 * part * part); };
  body.lasting.push_back({contact.id, calc_share(max)});
  if (contact.time_s <= body.sounds_until_s) call_damping(body, calc_share(sounding));
}

void hold_contacts(SelectedBody& body, double time_s, Hearing& hearing) {
  for (const SelectedBody::Driving& one : body.driving) call_motion(body, one.last, time_s, hearing);
  if (time_s > body.sounds_until_s) return;
  for (const SelectedBody::Lasting& one : body.lasting) call_damping(body, one.share);
}

}  // namespace carillon::effects
