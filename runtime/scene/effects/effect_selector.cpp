// Method:     every event may call for effects: a strike for its modes and its acceleration noise, a motion if the path to a microphone
//             changes audibly while the body sounds, a lasting contact if it slides, rolls or takes energy. A body gets all effects that
//             were called for. The rules compare an A-weighted share of exposure with one threshold.
// Source:     Zwislocki 1969 (integration time of the ear); the equations of each rule in docs/effects.md.
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

/// The effect on which another one acts.
std::optional<Effect> find_base(Effect effect) {
  if (kContactEffects.has(effect)) return Effect::kModal;
  if (effect == Effect::kDirectivity || effect == Effect::kNonlinear) return Effect::kModal;
  if (effect == Effect::kCascade) return Effect::kNonlinear;
  if (effect == Effect::kHead) return Effect::kTwoEars;
  if (effect == Effect::kDoppler) return Effect::kAirDelay;
  return std::nullopt;
}

/// Effects of a body by the rules that need no events.
void find_possible(SelectedBody& body, const Hearing& hearing) {
  const BodyFacts& of = *body.facts;
  const SceneFacts& facts = hearing.facts;
  body.possible = EffectSet::all();
  if (of.fixed) body.refuse(Effect::kAccelerationNoise, {.rule = Rule::kFixed});
  if (of.bank->multipoles.is_empty()) body.refuse(Effect::kDirectivity, {.rule = Rule::kNoMultipoles});
  if (of.bank->quartic.is_empty()) body.refuse(Effect::kNonlinear, {.rule = Rule::kNoEnergy});
  if (!body.has_cascade) body.refuse(Effect::kCascade, {.rule = of.bank->quartic.is_empty() ? Rule::kNoEnergy : Rule::kNothingAbove});
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

/// Effects of a body by its calls.
EffectSet decide(const SelectedBody& body) {
  const EffectOverrides& overrides = body.facts->overrides;
  if (!overrides.automatic) return overrides.on.without(overrides.off);
  EffectSet set = overrides.on.with(body.called);
  for (const Effect effect : overrides.on)
    if (const auto base = find_base(effect)) set = set.with(*base);  // forced effects bring their bases
  set = set.without(overrides.off);
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

}  // namespace

/// Invariant: all events up to `tick` have been judged.
struct EffectSelector::State {
  struct Pending {
    double from_s = 0.0;
    std::int64_t order = 0;
    events::Event event;
    bool operator<(const Pending& other) const { return from_s != other.from_s ? from_s > other.from_s : order > other.order; }
  };

  explicit State(SceneFacts facts) : hearing(std::move(facts)) {}

  Hearing hearing;
  std::map<const bank::Bank*, std::unique_ptr<BankLevels>> banks;
  std::vector<SelectedBody> bodies;
  std::priority_queue<Pending> pending;
  std::int64_t order = 0, tick = 0;

  void begin_walk(double time_s);
  void apply(const events::Event& event);
};

EffectSelector::EffectSelector(SceneFacts facts) : state_(std::make_unique<State>(std::move(facts))) {
  State& s = *state_;
  const std::vector<BodyFacts>& bodies = s.hearing.facts.bodies;
  s.bodies.reserve(bodies.size());
  for (const BodyFacts& of : bodies) {
    if (of.bank == nullptr) throw InputError(fmt::format("\"{}\": no bank to choose effects by", of.name));
    auto& levels = s.banks[of.bank];
    if (!levels) levels = std::make_unique<BankLevels>(*of.bank, s.hearing.facts.rate_hz, of.sphere_radius_m, of.transfers.get());
    find_possible(s.bodies.emplace_back(of, *levels, s.hearing), s.hearing);
  }
}

EffectSelector::~EffectSelector() = default;
EffectSelector::EffectSelector(EffectSelector&&) noexcept = default;

/// The listener moves by events from now on, which makes Doppler possible.
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

void EffectSelector::advance(double known_s) {
  State& s = *state_;
  for (;; ++s.tick) {
    const double time_s = static_cast<double>(s.tick) * kTickS, seen_s = time_s + kTickS;
    if (!(time_s <= s.hearing.facts.duration_s) || !(seen_s <= known_s)) break;
    while (!s.pending.empty() && s.pending.top().from_s <= seen_s) {
      s.apply(s.pending.top().event);
      s.pending.pop();
    }
    for (SelectedBody& body : s.bodies) {
      if (!s.hearing.listener.is_still()) body.call_propagation(s.hearing, seen_s);
      hold_contacts(body, seen_s, s.hearing);
    }
  }
}

EffectSet EffectSelector::choose(int body) const { return decide(state_->bodies.at(body)); }

BodyPlan EffectSelector::get_plan(int number) const {
  const SelectedBody& body = state_->bodies.at(number);
  const EffectOverrides& overrides = body.facts->overrides;
  const EffectSet set = decide(body);
  BodyPlan plan;
  for (const Effect effect : EffectSet::all()) {
    SelectionReason& reason = plan[effect].reason;
    plan[effect].on = set.has(effect);
    reason = body.reason[effect];
    const bool forced = overrides.on.has(effect) || overrides.off.has(effect);
    if (forced || !overrides.automatic) {
      reason = {.rule = forced && (overrides.automatic || overrides.on.has(effect)) ? Rule::kForced : Rule::kNotOffered};
      continue;
    }
    const auto base = find_base(effect);
    if (base && (overrides.off.has(*base) || (!set.has(*base) && body.possible.has(effect))))
      reason = {.rule = Rule::kNeedsOther, .other = *base};
    if (set.has(effect) && reason.rule == Rule::kNotStruck) reason = {.rule = Rule::kForced};  // base of a forced effect
  }
  return plan;
}

double EffectSelector::calc_silence_pa(int number) const {
  constexpr double kStandardPa = 1e-10;  // ResonatorOptions::silence_pa
  constexpr double kMargin = 0.5;        // for bodies that come nearer and modes that add up
  const SelectedBody& body = state_->bodies.at(number);
  if (!(state_->hearing.loudest_pa2_s > 0.0)) return kStandardPa;
  const double quiet_pa = kReferencePa * std::pow(10.0, state_->hearing.calc_inaudible_db() / 20.0);
  return std::max(kStandardPa, kMargin * quiet_pa * body.nearest_m);
}

}  // namespace carillon::effects
