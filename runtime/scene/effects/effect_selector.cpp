// Method:     every event calls for effects until a time: a strike, while its modes and its click are heard; a motion, when a path to a
//             microphone has changed audibly; a lasting contact, while it slides, rolls or takes energy. Events wait for their decisions;
//             on a grid of time each body has the effects of its calls, and kHoldS longer. All rules compare an A-weighted share of
//             exposure with one threshold.
// Source:     Zwislocki 1969 (the ear's time); the equations of each rule in docs/effects.md.
// Deviations: none.
#include "runtime/scene/effects/effect_selector.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <queue>
#include <utility>

#include "runtime/base/error.hpp"
#include "runtime/scene/effects/contact_rules.hpp"
#include "runtime/scene/effects/hearing.hpp"
#include "runtime/scene/effects/selected_body.hpp"
#include "runtime/scene/effects/strike_rules.hpp"
#include "runtime/synth/propagation.hpp"
#include "runtime/synth/pulse.hpp"

namespace carillon::effects {
namespace {

using Rule = SelectionReason::Rule;
using synth::kContactEffects;
// While a contact lasts: one of its effects in addition to Costs::force_sample_ns, and one mode that it drives, one sample. Of a bunny of
// 251 modes and shelves of 63 and 95 (carillon-render --report of the demo's scene, AMD EPYC, Zen 5), not measured again by
// measure_costs().
constexpr double kContactSampleNs = 35.0;
constexpr double kDrivenModeSampleNs = 1.2;

/// The effect on which another one acts.
std::optional<Effect> find_base(Effect effect) {
  if (kContactEffects.has(effect)) return Effect::kModal;
  if (effect == Effect::kDirectivity || effect == Effect::kNonlinear) return Effect::kModal;
  if (effect == Effect::kCascade) return Effect::kNonlinear;
  if (effect == Effect::kHead) return Effect::kTwoEars;
  if (effect == Effect::kDoppler) return Effect::kAirDelay;
  return std::nullopt;
}

/// The effects of a body by the rules that need no events.
void find_possible(SelectedBody& body, const Hearing& hearing) {
  const BodyFacts& of = *body.facts;
  const SceneFacts& facts = hearing.facts;
  body.possible = synth::kCompiledEffects;
  if (of.fixed) body.refuse(Effect::kAccelerationNoise, {.rule = Rule::kFixed});
  if (of.bank->multipoles.is_empty()) body.refuse(Effect::kDirectivity, {.rule = Rule::kNoMultipoles});
  if (of.bank->quartic.is_empty()) body.refuse(Effect::kNonlinear, {.rule = Rule::kNoEnergy});
  if (!(body.cascade_ns > 0.0))
    body.refuse(Effect::kCascade, {.rule = of.bank->quartic.is_empty() ? Rule::kNoEnergy : Rule::kNothingAbove});
  if (!facts.floor) body.refuse(Effect::kGroundReflection, {.rule = Rule::kNoFloor});
  if (!facts.has_head) body.refuse(Effect::kHead, {.rule = Rule::kNoHead});
  if (facts.microphones_m.size() < 2) body.refuse(Effect::kTwoEars, {.rule = Rule::kOneMicrophone});
  if (!facts.moves) {
    for (const Effect effect : kContactEffects) body.refuse(effect, {.rule = Rule::kNoContact});
  }
  if (of.fixed && hearing.listener.is_still() && !hearing.has_walk) body.refuse(Effect::kDoppler, {.rule = Rule::kStill});
  if (!body.bank->can_ring()) {
    for (const Effect effect : kContactEffects.with(Effect::kModal)) body.refuse(effect, {.rule = Rule::kNoModes});
  }
  const bool silent = !body.bank->can_ring() && of.fixed;
  if (silent || (!facts.moves && !of.struck)) {
    for (const Effect effect : body.possible) body.refuse(effect, {.rule = silent ? Rule::kNoModes : Rule::kNotStruck});
  }
}

/// The effects of a body at a time of the grid.
EffectSet decide(const SelectedBody& body, double time_s) {
  const EffectOverrides& overrides = body.facts->overrides;
  EffectSet set = overrides.on;
  if (overrides.automatic) {
    for (const Effect effect : EffectSet::all()) {
      const auto base = find_base(effect);
      if (overrides.on.has(effect) && base) set = set.with(*base);  // forced effects bring their bases
      if (body.until_s[effect] + kHoldS >= time_s) set = set.with(effect);
    }
  }
  set = set.without(overrides.off);
  if (!overrides.automatic) return set;
  for (const Effect effect : EffectSet::all()) {
    const auto base = find_base(effect);
    if (base && !set.has(*base) && !overrides.on.has(effect)) set = set.without(effect);
  }
  if (!set.has(Effect::kModal) && !set.has(Effect::kAccelerationNoise)) {
    for (const Effect effect :
         {Effect::kHertzPulse, Effect::kAirDelay, Effect::kDoppler, Effect::kTwoEars, Effect::kGroundReflection, Effect::kHead}) {
      if (!overrides.on.has(effect)) set = set.without(effect);
    }
  }
  return set;
}

/// The change of a body to these effects, with its reasons; counts in the plan.
EffectChange make_change(SelectedBody& body, int number, EffectSet set, double time_s) {
  const EffectOverrides& overrides = body.facts->overrides;
  EffectChange change{time_s, number, set, {}};
  for (const Effect effect : EffectSet::all()) {
    const bool on = set.has(effect);
    if (body.decided && on == body.now.has(effect)) continue;
    EffectPlan& plan = body.plan.effects[effect];
    if (on && !plan.ever) plan.first_s = time_s;
    plan.ever = plan.ever || on;
    plan.switched += on;
    const bool forced = !overrides.automatic || overrides.on.has(effect) || overrides.off.has(effect);
    SelectionReason reason = on ? body.call_reason[effect] : body.decided ? SelectionReason{.rule = Rule::kSilent} : body.reason[effect];
    if (forced) reason = {.rule = overrides.automatic || on ? Rule::kForced : Rule::kNotOffered};
    change.switches.push_back({effect, on, reason});
  }
  return change;
}

/// The costs of one tick with the present effects of the body.
void add_costs(SelectedBody& body, const Hearing& hearing, double time_s) {
  const SceneFacts& facts = hearing.facts;
  const Costs& costs = hearing.costs;
  const double travel_s = body.nearest_m / bank::kSoundSpeedMs;
  if (time_s > body.sounds_until_s + travel_s || time_s >= facts.duration_s) return;
  const double samples = kTickS * facts.rate_hz, all = static_cast<double>(facts.microphones_m.size());
  const bool has_head = synth::has_head(body.now);
  const double ears = body.now.has(Effect::kTwoEars) && !has_head ? all : 1.0;
  const auto add = [&](Effect effect, double ns) {
    if (body.now.has(effect)) body.plan.effects[effect].cost_us += 1e-3 * samples * ns;
  };
  add(Effect::kModal, costs.voice_sample_ns);
  add(Effect::kAirDelay, costs.ear_sample_ns);
  add(Effect::kTwoEars, (ears - 1.0) * costs.ear_sample_ns);
  add(Effect::kDoppler, ears * (costs.moving_ear_sample_ns - costs.ear_sample_ns));
  const bool moves = body.now.has(Effect::kDoppler);
  const double reflected = body.now.has(Effect::kGroundReflection) ? 2.0 : 1.0, modes = static_cast<double>(body.bank->get_modes().size());
  const double dipoles_ns = body.now.has(Effect::kAccelerationNoise) ? costs.dipole_ear_sample_ns : 0.0;
  add(Effect::kGroundReflection, ears * ((moves ? costs.moving_ear_sample_ns : costs.ear_sample_ns) + dipoles_ns));
  if (has_head) add(Effect::kHead, reflected * (moves ? costs.moving_head_sample_ns : costs.head_sample_ns));
  // Every ear sounds the modes by itself; with changing weights twice, and with one look-up a block.
  add(Effect::kDirectivity,
      ears * reflected * modes * (moves ? 2.0 * costs.mode_sample_ns + costs.transfer_ns / synth::kBlock : costs.mode_sample_ns));
  add(Effect::kNonlinear, body.coupling_ns);
  add(Effect::kCascade, body.cascade_ns);
  add(Effect::kAccelerationNoise, ears * costs.dipole_ear_sample_ns + costs.click_sample_ns);
  // The cost of driven modes counts to the first of the effects, as in the measurement.
  double driven_ns = kDrivenModeSampleNs * static_cast<double>(body.bank->get_modes().size());
  for (const Effect effect : kContactEffects) {
    if (time_s > body.driven_until_s) break;
    add(effect, std::max(1.0, static_cast<double>(body.driving.size())) * (costs.force_sample_ns + kContactSampleNs + driven_ns));
    if (body.now.has(effect)) driven_ns = 0.0;
  }
}

}  // namespace

/// Invariant: all events up to `tick` have been applied, so that its decisions do not depend on later ones.
struct EffectSelector::State {
  struct Pending {
    double from_s = 0.0;
    std::int64_t order = 0;
    events::Event event;
    bool operator<(const Pending& other) const { return from_s != other.from_s ? from_s > other.from_s : order > other.order; }
  };

  State(SceneFacts facts, const Costs& costs) : hearing(std::move(facts), costs) {}

  Hearing hearing;
  std::map<const bank::Bank*, std::unique_ptr<BankLevels>> banks;
  std::vector<SelectedBody> bodies;
  std::priority_queue<Pending> pending;
  std::int64_t order = 0, tick = 0;

  void begin_walk(double time_s);
  void apply(const events::Event& event);
};

EffectSelector::EffectSelector(SceneFacts facts, const Costs& costs) : state_(std::make_unique<State>(std::move(facts), costs)) {
  State& s = *state_;
  const std::vector<BodyFacts>& bodies = s.hearing.facts.bodies;
  s.bodies.reserve(bodies.size());
  for (const BodyFacts& of : bodies) {
    if (of.bank == nullptr) throw InputError(fmt::format("the plan of \"{}\" needs its bank", of.name));
    auto& levels = s.banks[of.bank];
    if (!levels) levels = std::make_unique<BankLevels>(*of.bank, s.hearing.facts.rate_hz, of.sphere_radius_m, of.transfers.get());
    find_possible(s.bodies.emplace_back(of, *levels, s.hearing), s.hearing);
  }
}

EffectSelector::~EffectSelector() = default;
EffectSelector::EffectSelector(EffectSelector&&) noexcept = default;

/// Motion of the listener by events from now on, which makes Doppler possible.
void EffectSelector::State::begin_walk(double time_s) {
  hearing.begin_walk(time_s);
  for (SelectedBody& body : bodies) {
    SelectionReason& reason = body.reason[Effect::kDoppler];
    if (body.possible.has(Effect::kDoppler) || reason.rule != Rule::kStill) continue;
    reason = {};
    find_possible(body, hearing);
  }
}

void EffectSelector::State::apply(const events::Event& event) {
  const auto find_body = [&](std::int32_t body) -> SelectedBody& { return bodies[body]; };
  if (const auto* impulse = std::get_if<events::Impulse>(&event)) judge(find_body(impulse->body), *impulse, hearing);
  if (const auto* force = std::get_if<events::Force>(&event)) judge(find_body(force->body), *force, hearing);
  if (const auto* contact = std::get_if<events::LastingContact>(&event)) judge(find_body(contact->body), *contact, hearing);
  if (const auto* motion = std::get_if<events::BodyMotion>(&event)) {
    SelectedBody& body = find_body(motion->body);
    body.position_m = motion->position_m;
    body.call_propagation(hearing, motion->time_s);
  }
}

EffectSet EffectSelector::get_possible(int body) const {
  const std::size_t i = body;
  const EffectOverrides& overrides = state_->hearing.facts.bodies.at(i).overrides;
  const EffectSet offered = overrides.automatic ? state_->bodies[i].possible.with(overrides.on) : overrides.on;
  return offered.without(overrides.off);
}

bool EffectSelector::needs_contacts() const {
  for (std::size_t i = 0; i < state_->bodies.size(); ++i) {
    const EffectSet possible = get_possible(static_cast<int>(i));
    if (state_->hearing.facts.moves && possible.has_any(kContactEffects)) return true;
  }
  return false;
}

void EffectSelector::watch(const events::Event& event) {
  State& s = *state_;
  double from_s = events::get_time_s(event);
  const auto is_ours = [&](std::int32_t body) { return body >= 0 && body < std::ssize(s.bodies); };
  if (events::find_fault(event) != nullptr) return;
  if (const auto* impulse = std::get_if<events::Impulse>(&event)) {
    if (!is_ours(impulse->body)) return;
    const double lead = s.bodies[impulse->body].bank->get_radius_m() / bank::kSoundSpeedMs;
    from_s -= 0.5 * synth::calc_pulse_length(impulse->shape, impulse->duration_s) + lead;
  } else if (const auto* force = std::get_if<events::Force>(&event)) {
    if (!is_ours(force->body)) return;
    from_s -= s.bodies[force->body].bank->get_radius_m() / bank::kSoundSpeedMs;
  } else if (const auto* contact = std::get_if<events::LastingContact>(&event)) {
    if (!is_ours(contact->body)) return;
  } else if (const auto* motion = std::get_if<events::BodyMotion>(&event)) {
    if (!is_ours(motion->body)) return;
  } else if (const auto* listener = std::get_if<events::Listener>(&event)) {
    if (!s.hearing.has_walk) s.begin_walk(listener->time_s);
    s.hearing.listener.push({listener->time_s, listener->position_m, listener->velocity_m_s});
    return;
  } else {
    return;
  }
  s.pending.push({from_s, s.order++, event});
}

std::vector<EffectChange> EffectSelector::advance(double known_s) {
  State& s = *state_;
  std::vector<EffectChange> changes;
  for (;; ++s.tick) {
    const double time_s = static_cast<double>(s.tick) * kTickS, seen_s = time_s + kTickS + s.hearing.facts.thresholds.lead_s;
    if (!(time_s <= s.hearing.facts.duration_s) || !(seen_s <= known_s)) break;
    while (!s.pending.empty() && s.pending.top().from_s <= seen_s) {
      s.apply(s.pending.top().event);
      s.pending.pop();
    }
    for (std::size_t i = 0; i < s.bodies.size(); ++i) {
      SelectedBody& body = s.bodies[i];
      if (!s.hearing.listener.is_still()) body.call_propagation(s.hearing, seen_s);
      hold_contacts(body, seen_s, s.hearing);
      const EffectSet set = decide(body, time_s);
      if (set != body.now || !body.decided) {
        changes.push_back(make_change(body, static_cast<int>(i), set, time_s));
        body.now = set;
        body.decided = true;
      }
      for (const Effect effect : set) {
        EffectPlan& plan = body.plan.effects[effect];
        plan.last_s = std::min(time_s + kTickS, s.hearing.facts.duration_s);
        plan.on_s += std::max(0.0, plan.last_s - time_s);
      }
      add_costs(body, s.hearing, time_s);
    }
  }
  return changes;
}

double EffectSelector::get_time_s() const { return static_cast<double>(state_->tick) * kTickS; }

BodyPlan EffectSelector::get_plan(int number) const {
  const std::size_t i = number;
  const SelectedBody& body = state_->bodies.at(i);
  const EffectOverrides& overrides = state_->hearing.facts.bodies[i].overrides;
  BodyPlan plan = body.plan;
  for (const Effect effect : EffectSet::all()) {
    EffectPlan& of = plan.effects[effect];
    of.reason = body.reason[effect];
    if (!of.ever) of.cost_us = 0.0;
    const bool forced = overrides.on.has(effect) || overrides.off.has(effect);
    if (forced || !overrides.automatic) {
      of.reason = {.rule = forced && (overrides.automatic || overrides.on.has(effect)) ? Rule::kForced : Rule::kNotOffered};
      continue;
    }
    const auto base = find_base(effect);
    if (base && (overrides.off.has(*base) || (!plan[*base].ever && body.possible.has(effect)))) {
      of.reason = {.rule = Rule::kNeedsOther, .other = *base};
    }
    if (of.ever && of.reason.rule == Rule::kNotStruck) of.reason = {.rule = Rule::kForced};  // as a base
  }
  return plan;
}

double EffectSelector::calc_silence_pa(int number) const {
  constexpr double kStandardPa = 1e-10;  // of VoiceOptions
  constexpr double kMargin = 0.5;        // of the inaudible level, for bodies that come nearer and modes that add up
  const SelectedBody& body = state_->bodies.at(number);
  if (!(state_->hearing.loudest_pa2_s > 0.0)) return kStandardPa;
  const double quiet_pa = kReferencePa * std::pow(10.0, state_->hearing.calc_inaudible_db() / 20.0);
  return std::max(kStandardPa, kMargin * quiet_pa * body.nearest_m);
}

}  // namespace carillon::effects
