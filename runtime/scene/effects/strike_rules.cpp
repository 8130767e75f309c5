// Source:     the equations of each rule in docs/effects.md.
// Deviations: modes do not mask each other.
#include "runtime/scene/effects/strike_rules.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>
#include <span>
#include <utility>
#include <vector>

namespace carillon::effects {
namespace {

using Rule = SelectionReason::Rule;
constexpr std::size_t kMaxPulses = 16;  // open pulses in pieces

/// Sound of a strike at the nearest microphone.
struct StrikeSound {
  double time_s = 0.0, half_s = 0.0;  // middle and half length of the pulse
  double distance_m = 0.0, spreading = 0.0;
  StrikeLevels levels;
  ClickLevels click;
  double heard = 0.0, clicked = 0.0;                      // exposures [Pa^2 s]: of the modes, of the acceleration noise
  double modal_db = 0.0, click_db = 0.0, limit_db = 0.0;  // dB(A)
  double calc_share(double part) const { return heard + clicked > 0.0 ? part / (heard + clicked) : 0.0; }
};

/// Sound of a pulse at the nearest microphone, by its projections in `hearing`.
StrikeSound hear(SelectedBody& body, const events::Impulse& impulse, Hearing& hearing) {
  StrikeSound sound;
  sound.time_s = impulse.time_s;
  sound.half_s = 0.5 * impulse.duration_s;
  sound.levels = calc_strike_levels(*body.bank, hearing.projection, impulse.shape, impulse.duration_s, hearing.amplitude_pa);
  sound.distance_m = hearing.find_ways(body.position_m, impulse.time_s);
  sound.spreading = 1.0 / (sound.distance_m * sound.distance_m);
  if (!body.facts->fixed) sound.click = body.bank->calc_click_levels(norm(impulse.impulse_n_s), impulse.shape, impulse.duration_s);
  const double pushed =
      body.bank->calc_pushed_pa2_s(impulse.triangle, impulse.barycentric, impulse.impulse_n_s, impulse.shape, impulse.duration_s);
  sound.heard = (sound.levels.modal_pa2_s + pushed) * sound.spreading;
  sound.clicked = sound.click.pa2_s * sound.spreading;
  hearing.loudest_pa2_s = std::max(hearing.loudest_pa2_s, sound.heard + sound.clicked);
  body.ring_pa2_s = std::max(sound.heard, body.ring_pa2_s * std::pow(10.0, -6.0 * std::max(0.0, impulse.time_s - body.ring_s)));
  body.ring_s = impulse.time_s;
  sound.limit_db = hearing.calc_inaudible_db();
  sound.modal_db = calc_level_db(sound.heard);
  sound.click_db = calc_level_db(sound.clicked);
  return sound;
}

/// Audible ring of the modes by their amplitudes in `hearing`. Returns the time when the last one becomes inaudible.
double ring_out(SelectedBody& body, const StrikeSound& sound, const Hearing& hearing) {
  const double quiet_pa = hearing.calc_quiet_pa(sound.limit_db, sound.distance_m, hearing.amplitude_pa.size());
  const std::span<const BankLevels::Mode> modes = body.bank->get_modes();
  std::vector<double> levels = hearing.amplitude_pa;
  for (std::size_t m = 0; m < modes.size(); ++m) levels[m] = levels[m] * modes[m].weight / quiet_pa;
  return std::max(body.ring_out(sound.time_s, levels), sound.time_s + sound.half_s);
}

/// Calls for directivity by the exposure-weighted spread of the modes.
void call_directivity(SelectedBody& body, const StrikeSound& sound, const std::vector<double>& amplitude_pa) {
  if (!body.possible.has(Effect::kDirectivity)) return;
  if (const double clear_db = sound.limit_db + kDirectionClearDb; !(sound.modal_db > clear_db)) {
    body.call(Effect::kDirectivity, 0.0,
              {.rule = Rule::kFaint, .value = sound.modal_db, .limit = clear_db, .distance_m = sound.distance_m});
    return;
  }
  const std::span<const BankLevels::Mode> modes = body.bank->get_modes();
  double spread = 0.0, all = 0.0;
  for (std::size_t m = 0; m < modes.size(); ++m) {
    const double exposure = std::pow(amplitude_pa[m] * modes[m].weight, 2.0) / modes[m].decay_per_s;
    spread += exposure * modes[m].spread_db;
    all += exposure;
  }
  body.call_directivity(all > 0.0 ? spread / all : body.bank->get_spread_db());
}

/// Calls for audible modes. Returns the end of their sound at the body.
double call_modes(SelectedBody& body, const StrikeSound& sound, const Hearing& hearing) {
  if (!(sound.modal_db > sound.limit_db)) {
    body.call(Effect::kModal, 0.0, {.rule = Rule::kTooQuiet, .value = sound.modal_db, .limit = sound.limit_db});
    return kNever;
  }
  const double end_s = ring_out(body, sound, hearing), share = sound.calc_share(sound.heard);
  const bool counts = share > body.audible_share || body.facts->overrides.off.has(Effect::kAccelerationNoise);
  body.call(Effect::kModal, counts ? 1.0 + sound.heard : share,
            counts ? SelectionReason{.rule = Rule::kHeard, .value = sound.modal_db, .distance_m = sound.distance_m}
                   : SelectionReason{.rule = Rule::kChange, .value = to_db(share), .limit = to_db(body.audible_share)});
  if (sound.levels.mean_hz > body.mean_hz) body.mean_hz = sound.levels.mean_hz;
  call_directivity(body, sound, hearing.amplitude_pa);
  return end_s;
}

/// Calls by the frequency rise of a lone coupled mode at the amplitude q left by strikes: for q'' + lambda q + 2 a^2 q^3 = 0 and
/// alpha = 2 a^2 q^2 / lambda the frequency grows by 3 alpha / 8 to first order.
void call_nonlinear(SelectedBody& body, const events::Impulse& impulse, const std::vector<double>& projection) {
  if (!body.possible.has(Effect::kNonlinear)) return;
  const bank::Bank& bank = body.bank->get_bank();
  const std::vector<std::int32_t>& coupled = bank.quartic.modes;
  const std::span<const BankLevels::Mode> modes = body.bank->get_modes();
  const double passed_s = std::max(0.0, impulse.time_s - body.swing_s);
  body.swing_s = std::max(body.swing_s, impulse.time_s);
  double cents = 0.0;
  for (std::size_t i = 0, m = 0; i < coupled.size(); ++i) {
    while (m < modes.size() && modes[m].index < coupled[i]) ++m;
    if (m == modes.size() || modes[m].index != coupled[i]) continue;
    const std::size_t mode = coupled[i];
    const double lambda = bank.eigenvalue_rad2_s2[mode], decay_per_s = std::max(modes[m].decay_per_s, 1e-9);
    const double pulse = calc_pulse_spectrum(impulse.shape, modes[m].freq_hz * impulse.duration_s);
    body.swing[i] = body.swing[i] * std::exp(-decay_per_s * passed_s) + projection[m] * pulse / std::sqrt(lambda);
    const double alpha = 2.0 * body.self[i] * body.swing[i] * body.swing[i] / lambda;
    cents = std::max(cents, 1200.0 / std::numbers::ln2 * 0.375 * alpha);
  }
  for (const auto& [effect, limit] : {std::pair{Effect::kNonlinear, kHardeningCents}, std::pair{Effect::kCascade, kCascadeCents}})
    body.call(effect, cents, {.rule = Rule::kHardens, .value = cents, .limit = limit}, limit);
}

/// Calls for audible acceleration noise of a body that is not fixed. Returns the end of that sound at the body.
double call_acceleration_noise(SelectedBody& body, const StrikeSound& sound) {
  if (!(sound.click_db > sound.limit_db)) {
    body.call(Effect::kAccelerationNoise, 0.0, {.rule = Rule::kTooQuiet, .value = sound.click_db, .limit = sound.limit_db});
    return kNever;
  }
  const double share = sound.clicked / (sound.clicked + body.ring_pa2_s);
  const bool thumps = bank::kSoundSpeedMs / (2.0 * std::numbers::pi * body.bank->get_radius_m()) < kThumpHz;
  const double limit = thumps ? kThumpShare / (1.0 + kThumpShare) : body.audible_share;
  body.call(Effect::kAccelerationNoise, share,
            {.rule = thumps ? Rule::kThump : Rule::kChange, .value = to_db(share), .limit = to_db(limit), .distance_m = sound.click_db},
            limit);
  if (!(share > limit) || body.facts->overrides.off.has(Effect::kAccelerationNoise)) return kNever;
  body.mean_hz = std::max(body.mean_hz, sound.click.mean_hz);
  return sound.time_s + sound.half_s;
}

}  // namespace

void judge(SelectedBody& body, const events::Impulse& impulse, Hearing& hearing) {
  if (!body.bank->calc_projections(impulse.triangle, impulse.barycentric, impulse.impulse_n_s, hearing.projection)) return;
  const StrikeSound sound = hear(body, impulse, hearing);
  double end_s = call_modes(body, sound, hearing);
  if (end_s != kNever) call_nonlinear(body, impulse, hearing.projection);
  if (!body.facts->fixed) end_s = std::max(end_s, call_acceleration_noise(body, sound));
  if (end_s == kNever) {
    body.call(Effect::kHertzPulse, 0.0, {.rule = Rule::kTooQuiet, .value = sound.modal_db, .limit = sound.limit_db});
    return;
  }
  // Exposure of the difference to an impulse of no length: in the modes and in the acceleration noise.
  const double lost = sound.calc_share((sound.levels.pulse_loss_pa2_s + sound.click.pulse_loss_pa2_s) * sound.spreading);
  body.call(Effect::kHertzPulse, lost, {.rule = Rule::kChange, .value = to_db(lost), .limit = to_db(body.audible_share)});
  body.sounds_until_s = std::max(body.sounds_until_s, end_s);
  body.call_propagation(hearing, impulse.time_s);
}

void judge(SelectedBody& body, const events::Force& force, Hearing& hearing) {
  const double end_s = force.time_s + force.calc_length_s();
  const auto continues_pulse = [&](const events::Impulse& pulse) {
    return pulse.other == force.other && pulse.triangle == force.triangle &&
           std::abs(pulse.time_s + 0.5 * pulse.duration_s - force.time_s) < 0.01 * force.step_s;
  };
  auto pulse = force.continues ? std::find_if(body.pulses.begin(), body.pulses.end(), continues_pulse) : body.pulses.end();
  if (pulse == body.pulses.end()) {
    if (body.pulses.size() == kMaxPulses) body.pulses.erase(body.pulses.begin());
    body.pulses.push_back(events::to_impulse(force));
    pulse = std::prev(body.pulses.end());
    pulse->duration_s = force.calc_length_s();
  } else {
    const Vec3 more = events::calc_impulse(force);
    for (std::size_t k = 0; k < 3; ++k) pulse->impulse_n_s[k] += more[k];
    pulse->duration_s += force.calc_length_s();
  }
  pulse->time_s = end_s - 0.5 * pulse->duration_s;
  judge(body, *pulse, hearing);
}

}  // namespace carillon::effects
