// Source:     the equations of each rule in docs/effects.md.
// Deviations: phase errors are evaluated at the mean frequency of the loudest strike.
#include "runtime/scene/effects/selected_body.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "runtime/synth/propagation.hpp"
#include "runtime/synth/receiver.hpp"

namespace carillon::effects {
namespace {

using Rule = SelectionReason::Rule;

}  // namespace

SelectedBody::SelectedBody(const BodyFacts& of, const BankLevels& levels, Hearing& hearing)
    : facts(&of), bank(&levels), position_m(of.position_m), audible_share(hearing.facts.thresholds.audible_share) {
  share.fill(-1.0);
  for (const Effect effect : synth::kContactEffects) reason[effect] = {.rule = Rule::kNoContact};
  quiet_s.assign(levels.get_modes().size(), kNever);
  if (const bank::QuarticEnergy& energy = of.bank->quartic; !energy.is_empty()) {
    self = bank::calc_self_coupling(energy);
    swing.assign(energy.mode_count(), 0.0);
    const auto& modes = levels.get_modes();
    const bool is_any_above = !modes.empty() && modes.back().index > energy.modes.back();
    has_cascade = is_any_above && energy.thickness_m > 0.0 && of.bank->rigid.mass_kg > 0.0;
  }
  nearest_m = hearing.find_ways(position_m, 0.0);
  anchor_m = hearing.way_m;
}

void SelectedBody::refuse(Effect effect, const SelectionReason& why) {
  possible = possible.without(effect);
  reason[effect] = why;
}

void SelectedBody::call(Effect effect, double part, const SelectionReason& why, double limit) {
  if (!possible.has(effect)) return;
  if (part > share[effect]) {
    share[effect] = part;
    reason[effect] = why;
  }
  if (part > limit) called = called.with(effect);
}

void SelectedBody::call_directivity(double spread_db) {
  call(Effect::kDirectivity, spread_db,
       {.rule = spread_db > kDirectionDb ? Rule::kDirected : Rule::kSameAllRound, .value = spread_db, .limit = kDirectionDb}, kDirectionDb);
}

void SelectedBody::call_propagation(Hearing& hearing, double time_s) {
  const double nearest = hearing.find_ways(position_m, time_s);
  nearest_m = std::min(nearest_m, nearest);
  if (time_s > sounds_until_s) {
    anchor_m = hearing.way_m;
    return;
  }
  const double wave = 2.0 * std::numbers::pi * std::max(mean_hz, kLowestHz) / bank::kSoundSpeedMs;  // rad/m
  const double limit_m = std::sqrt(audible_share) / wave;
  const std::vector<double>& way_m = hearing.way_m;
  call(Effect::kAirDelay, wave * nearest * wave * nearest, {.rule = Rule::kAirTravel, .value = nearest, .limit = limit_m});
  double moved = 0.0, apart = 0.0;
  for (std::size_t m = 0; m < way_m.size(); ++m) {
    moved = std::max(moved, std::abs(way_m[m] - anchor_m[m]));
    apart = std::max(apart, std::abs(way_m[m] - hearing.middle_m));
  }
  if (way_m.size() > 1) {
    call(Effect::kTwoEars, wave * apart * wave * apart,
         {.rule = apart > limit_m ? Rule::kOtherWay : Rule::kSameWay, .value = apart, .limit = limit_m});
  }
  // A head changes the sound at each ear by decibels, wherever the body is.
  if (hearing.facts.has_head && !facts->overrides.off.has(Effect::kHead)) {
    for (const Effect effect : {Effect::kTwoEars, Effect::kHead}) call(effect, 1e30, {.rule = Rule::kByHead});
  }
  call(Effect::kDoppler, wave * moved * wave * moved,
       {.rule = moved > limit_m ? Rule::kMoving : Rule::kStill, .value = moved, .limit = limit_m});
  if (moved > limit_m) anchor_m = way_m;
  if (hearing.facts.floor && possible.has(Effect::kGroundReflection)) call_reflection(hearing, time_s);
}

/// Calls for the ground reflection by its level relative to the direct sound.
void SelectedBody::call_reflection(const Hearing& hearing, double time_s) {
  const synth::Floor& floor = *hearing.facts.floor;
  const Vec3 ear = hearing.listener.find(time_s).position_m;
  double part = 0.0;
  for (std::size_t m = 0; m < hearing.way_m.size(); ++m) {
    const Vec3 mirrored = floor.mirror(ear + hearing.facts.microphones_m[m]);
    const double distance_m = std::max(norm(mirrored - position_m), synth::kNearestM);
    part = std::max(part, std::pow(floor.reflection * hearing.way_m[m] / distance_m, 2.0));
  }
  call(Effect::kGroundReflection, part, {.rule = Rule::kReflected, .value = to_db(part), .limit = to_db(audible_share)});
}

double SelectedBody::ring_out(double time_s, const std::vector<double>& levels) {
  double end_s = kNever;
  const std::span<const BankLevels::Mode> modes = bank->get_modes();
  for (std::size_t m = 0; m < modes.size(); ++m) {
    if (!(levels[m] > 1.0)) continue;
    const double silent_s = time_s + std::log(levels[m]) / modes[m].decay_per_s;
    end_s = std::max(end_s, silent_s);
    quiet_s[m] = std::max(quiet_s[m], silent_s);
  }
  return end_s;
}

}  // namespace carillon::effects
