// All rules read and write the same state of a body; longer than most files.
// Method:     every event says what it calls for, and until when: a strike, for as long as its modes and its click are heard; a motion,
//             when a path to a microphone has changed by more than is heard; a lasting contact, while it slides, rolls or takes energy.
//             Events wait until the decisions reach the time before which their effects must be on; on a grid of time each body then has
//             what is still called for, and kHoldS longer. All rules compare an A-weighted share of exposure with one threshold.
// Source:     Zwislocki 1969 (the ear's time); the equations of each rule in docs/effects.md.
// Deviations: a phase error is taken at the mean frequency of the loudest strike; modes do not mask each other.
#include "runtime/effect_selection/effect_selector.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <numbers>
#include <optional>
#include <queue>
#include <utility>

#include "runtime/base/error.hpp"
#include "runtime/synth/propagation.hpp"
#include "runtime/synth/pulse.hpp"
#include "runtime/synth/receiver.hpp"

namespace carillon::effect_selection {
namespace {

using std::numbers::pi;
using Rule = SelectionReason::Rule;
constexpr double kRingS = 0.05;
constexpr double kRecordGapS = 0.01;    // a contact that moves has a record at least so often
constexpr std::size_t kMaxPulses = 16;  // that come in pieces and may continue
constexpr double kNever = -std::numeric_limits<double>::infinity();
constexpr double kAlways = std::numeric_limits<double>::infinity();
using synth::kContactEffects;
// While a contact lasts: one of its effects in addition to Costs::force_sample_ns, and one mode that it drives, one sample. Of a bunny of
// 251 modes and shelves of 63 and 95 (carillon-render --report of the demo's scene, AMD EPYC, Zen 5), not measured again where the program
// runs.
constexpr double kContactSampleNs = 35.0;
constexpr double kDrivenModeSampleNs = 1.2;

double calc_norm(const Vec3& x) { return std::hypot(x[0], x[1], x[2]); }

/// What an effect acts on: without it there is nothing to do.
std::optional<Effect> find_base(Effect effect) {
  if (kContactEffects.has(effect)) return Effect::kModal;
  if (effect == Effect::kDirectivity || effect == Effect::kNonlinear) return Effect::kModal;
  if (effect == Effect::kCascade) return Effect::kNonlinear;
  if (effect == Effect::kHead) return Effect::kTwoEars;
  if (effect == Effect::kDoppler) return Effect::kAirDelay;
  return std::nullopt;
}

/// Numbers of the matrices that are multiplied for a sample of coupled modes.
double count_multiplications(const bank::QuarticEnergy& energy) {
  const double modes = static_cast<double>(energy.mode_count()), rows = static_cast<double>(energy.row_count());
  if (energy.is_of_points()) {
    const double points = static_cast<double>(energy.point_count());
    return 2.0 * points * (static_cast<double>(energy.gradient_count()) * modes + static_cast<double>(energy.strain_count()) * rows);
  }
  // Rows without anything off their diagonals count as diagonals.
  double off = 0.0;
  for (const float entry : energy.rows) off += static_cast<double>(entry != 0.0F);
  return 2.0 * std::max(off, rows * modes);
}

double to_db(double share) { return 10.0 * std::log10(std::max(share, 1e-30)); }

}  // namespace

/// What it keeps true: all that was watched up to `tick` has been applied, so that what is decided there does not depend on what comes
/// later; until_s of an effect is the last time for which something called for it. The vectors at the end are working space of one call.
struct EffectSelector::State {
  struct Body {
    const BankLevels* bank = nullptr;
    EffectSet possible;
    Vec3 position_m{};
    double nearest_m = kAlways;             // to a microphone, so far
    double sounds_until_s = kNever;         // at the body
    double driven_until_s = kNever;         // by contacts that slide or roll; others cost next to nothing
    double mean_hz = 0.0;                   // of what is heard of it
    double ring_pa2_s = 0.0, ring_s = 0.0;  // modal exposure of its strikes, falling by 60 dB a second since ring_s
    std::vector<double> quiet_s;            // per mode of the bank's levels: when it is not heard any more
    std::vector<double> self;               // per coupled mode of the bank: sum of A_ii^2, bank::calc_self_coupling()
    std::vector<double> swing;              // per coupled mode: amplitude of q [m kg^1/2] that strikes have left, at swing_s
    double swing_s = 0.0;
    double coupling_ns = 0.0;      // of a sample
    double cascade_ns = 0.0;       // likewise; 0: no modes above the coupled ones
    std::vector<double> anchor_m;  // ways to the microphones by which kDoppler is judged
    synth::PerEffect<double> until_s{};
    synth::PerEffect<double> share{};          // the loudest call so far
    synth::PerEffect<SelectionReason> reason;  // of that call
    synth::PerEffect<SelectionReason> call;    // of the last one
    struct Lasting {
      std::uint64_t id = 0;
      double share = 0.0;  // of its damping, were all modes sounding
    };
    std::vector<Lasting> lasting;  // contacts that have not ended; of those that lie still no records come
    struct Driving {
      std::uint64_t id = 0;
      double since_s = 0.0;  // up to where the ring knows of it
      double size = 0.0;
      events::LastingContact strongest;  // of the records since
      events::LastingContact last;       // that holds until another comes
    };
    std::vector<Driving> driving;         // contacts that slide or roll
    std::vector<events::Impulse> pulses;  // what is known of those that come in pieces, the last ones
    std::vector<double> ring_m2_s2;       // per mode: mean square of q' [kg m^2 / s^2] that contacts have driven, at ring_at_s
    double ring_at_s = 0.0;
    EffectSet now;
    bool decided = false;
    BodyPlan plan;
  };
  /// A strike as it is heard at the nearest microphone.
  struct StrikeSound {
    double time_s = 0.0, half_s = 0.0;  // middle and half length of the pulse
    double distance_m = 0.0, travel_s = 0.0, spreading = 0.0;
    StrikeLevels levels;
    ClickLevels click;
    double heard = 0.0, clicked = 0.0;                      // exposures [Pa^2 s]: of the modes, of the acceleration noise
    double modal_db = 0.0, click_db = 0.0, limit_db = 0.0;  // dB(A)
    double calc_share(double part) const { return heard + clicked > 0.0 ? part / (heard + clicked) : 0.0; }
  };
  struct Pending {
    double from_s = 0.0;
    std::int64_t order = 0;
    events::Event event;
    bool operator<(const Pending& other) const { return from_s != other.from_s ? from_s > other.from_s : order > other.order; }
  };

  SceneFacts facts;
  Costs costs;
  synth::Trajectory listener{1};
  bool has_walk = false;  // that events give
  std::map<const bank::Bank*, std::unique_ptr<BankLevels>> banks;
  std::vector<Body> bodies;
  std::priority_queue<Pending> pending;
  std::int64_t order = 0, tick = 0;
  double loudest_pa2_s = 0.0;                                  // of all strikes so far
  Vec3 middle{};                                               // of the microphones
  double middle_m = 0.0;                                       // way to it
  std::vector<double> projection, amplitude_pa, way_m, power;  // working space

  double calc_inaudible_db() const { return std::min(kInaudibleDb, calc_level_db(loudest_pa2_s) - facts.thresholds.below_loudest_db); }
  void find_possible(std::size_t body);
  void begin_walk(double time_s);
  void refuse(Body& body, Effect effect, const SelectionReason& reason) {
    body.possible = body.possible.without(effect);
    body.reason[effect] = reason;
  }
  void reflect(Body& body, double time_s);
  void call_directivity(Body& body, const StrikeSound& sound, double until_s);
  void call_directivity(Body& body, double spread_db, double until_s);
  void call_nonlinear(Body& body, const events::Impulse& impulse, double until_s);
  double find_ways(const Body& body, double time_s);
  void call(Body& body, Effect effect, double share, double until_s, SelectionReason reason) {
    call(body, effect, share, until_s, reason, facts.thresholds.audible_share);
  }
  void call(Body& body, Effect effect, double share, double until_s, SelectionReason reason, double limit);
  void look(Body& body, double time_s);
  void apply(const Pending& pending);
  void apply(const events::Impulse& impulse);
  void apply(const events::Impulse& impulse, double work_ns, double new_s);
  StrikeSound hear(Body& body, const BodyFacts& of, const events::Impulse& impulse);
  double ring_out(Body& body, const StrikeSound& sound);
  double call_modes(Body& body, const BodyFacts& of, const StrikeSound& sound, double work_ns);
  double call_acceleration_noise(Body& body, const BodyFacts& of, const StrikeSound& sound);
  void apply(const events::Force& force);
  void apply(const events::LastingContact& contact);
  void damp(Body& body, double share, double time_s);
  void find_power(const Body& body, const events::LastingContact& contact, std::vector<double>& power);
  double ring(Body& body, const events::LastingContact& contact);
  std::array<synth::ContactSurface, 2> find_surfaces(const events::LastingContact& contact) const;
  bool offer(Body& body, const events::LastingContact& contact, double time_s);
  EffectSet decide(const BodyFacts& of, Body& body, double time_s) const;
  void add_costs(Body& body);
};

EffectSelector::EffectSelector(SceneFacts facts, const Costs& costs) : state_(std::make_unique<State>()) {
  State& s = *state_;
  s.facts = std::move(facts);
  s.costs = costs;
  if (s.facts.listener.empty()) s.facts.listener.push_back({});
  s.listener = synth::make_trajectory(s.facts.listener);
  if (s.facts.microphones_m.empty()) throw InputError("a plan needs at least one microphone");
  for (const Vec3& place : s.facts.microphones_m)
    for (std::size_t k = 0; k < 3; ++k) s.middle[k] += place[k] / static_cast<double>(s.facts.microphones_m.size());
  s.bodies.resize(s.facts.bodies.size());
  for (std::size_t i = 0; i < s.bodies.size(); ++i) {
    const BodyFacts& of = s.facts.bodies[i];
    if (of.bank == nullptr) throw InputError(fmt::format("the plan of \"{}\" needs its bank", of.name));
    auto& levels = s.banks[of.bank];
    if (!levels) levels = std::make_unique<BankLevels>(*of.bank, s.facts.rate_hz, of.sphere_radius_m, of.transfers.get());
    State::Body& body = s.bodies[i];
    body.bank = levels.get();
    body.position_m = of.position_m;
    body.until_s.fill(kNever);
    body.share.fill(-1.0);
    for (const Effect effect : kContactEffects) body.reason[effect] = {.rule = Rule::kNoContact};
    body.quiet_s.assign(levels->get_modes().size(), kNever);
    if (const bank::QuarticEnergy& energy = of.bank->quartic; !energy.is_empty()) {
      body.self = bank::calc_self_coupling(energy);
      body.swing.assign(energy.mode_count(), 0.0);
      body.coupling_ns =
          costs.coupled_mode_ns * static_cast<double>(energy.mode_count()) + costs.coupling_ns * count_multiplications(energy);
      const auto above = std::count_if(levels->get_modes().begin(), levels->get_modes().end(),
                                       [&](const BankLevels::Mode& mode) { return mode.index > energy.modes.back(); });
      if (energy.thickness_m > 0.0 && of.bank->rigid.mass_kg > 0.0) body.cascade_ns = costs.cascade_mode_ns * static_cast<double>(above);
    }
    body.nearest_m = s.find_ways(body, 0.0);
    body.anchor_m = s.way_m;
    s.find_possible(i);
  }
}

EffectSelector::~EffectSelector() = default;
EffectSelector::EffectSelector(EffectSelector&&) noexcept = default;

/// Rules that hold whatever happens.
void EffectSelector::State::find_possible(std::size_t number) {
  const BodyFacts& of = facts.bodies[number];
  Body& body = bodies[number];
  body.possible = synth::kCompiledEffects;
  if (of.fixed) refuse(body, Effect::kAccelerationNoise, {.rule = Rule::kFixed});
  if (of.bank->multipoles.is_empty()) refuse(body, Effect::kDirectivity, {.rule = Rule::kNoMultipoles});
  if (of.bank->quartic.is_empty()) refuse(body, Effect::kNonlinear, {.rule = Rule::kNoEnergy});
  if (!(body.cascade_ns > 0.0))
    refuse(body, Effect::kCascade, {.rule = of.bank->quartic.is_empty() ? Rule::kNoEnergy : Rule::kNothingAbove});
  if (!facts.floor) refuse(body, Effect::kGroundReflection, {.rule = Rule::kNoFloor});
  if (!facts.has_head) refuse(body, Effect::kHead, {.rule = Rule::kNoHead});
  if (facts.microphones_m.size() < 2) refuse(body, Effect::kTwoEars, {.rule = Rule::kOneMicrophone});
  if (!facts.moves) {
    for (const Effect effect : kContactEffects) refuse(body, effect, {.rule = Rule::kNoContact});
  }
  if (of.fixed && listener.is_still() && !has_walk) refuse(body, Effect::kDoppler, {.rule = Rule::kStill});
  if (!body.bank->can_ring()) {
    for (const Effect effect : kContactEffects.with(Effect::kModal)) refuse(body, effect, {.rule = Rule::kNoModes});
  }
  const bool silent = !body.bank->can_ring() && of.fixed;
  if (silent || (!facts.moves && !of.struck)) {
    for (const Effect effect : body.possible) refuse(body, effect, {.rule = silent ? Rule::kNoModes : Rule::kNotStruck});
  }
}

/// Events give the listener's way from now on; what was known of it before that time stays.
void EffectSelector::State::begin_walk(double time_s) {
  constexpr std::size_t kRemembered = 4096;  // waypoints
  const synth::Trajectory known = std::exchange(listener, synth::Trajectory(kRemembered));
  for (std::size_t i = 0; i < known.get_count(); ++i) {
    if (known.get_waypoint(i).time_s <= time_s) listener.push(known.get_waypoint(i));
  }
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    Body& body = bodies[i];
    SelectionReason& reason = body.reason[Effect::kDoppler];
    if (body.possible.has(Effect::kDoppler) || reason.rule != Rule::kStill) continue;
    reason = {};
    find_possible(i);
  }
}

/// The ways from the body to every microphone and to their middle, as if sound took no time; the shortest of the microphones.
double EffectSelector::State::find_ways(const Body& body, double time_s) {
  const Vec3 ear = listener.find(time_s).position_m;
  way_m.clear();
  for (const Vec3& offset : facts.microphones_m) {
    Vec3 way{};
    for (std::size_t k = 0; k < 3; ++k) way[k] = ear[k] + offset[k] - body.position_m[k];
    way_m.push_back(std::max(calc_norm(way), synth::kNearestM));
  }
  middle_m = 0.0;
  for (std::size_t k = 0; k < 3; ++k) middle_m += std::pow(ear[k] + middle[k] - body.position_m[k], 2.0);
  middle_m = std::max(std::sqrt(middle_m), synth::kNearestM);
  return *std::min_element(way_m.begin(), way_m.end());
}

/// Something calls for an effect with that share of the sound, until then.
void EffectSelector::State::call(Body& body, Effect effect, double share, double until_s, SelectionReason reason, double limit) {
  if (!body.possible.has(effect)) return;
  if (share > body.share[effect]) {
    body.share[effect] = share;
    body.reason[effect] = reason;
  }
  if (!(share > limit)) return;
  body.call[effect] = reason;
  body.until_s[effect] = std::max(body.until_s[effect], until_s);
}

/// The ways of a body's sound at that time.
void EffectSelector::State::look(Body& body, double time_s) {
  const double nearest = find_ways(body, time_s);
  body.nearest_m = std::min(body.nearest_m, nearest);
  if (time_s > body.sounds_until_s) return;
  const double travel_s = nearest / bank::kSoundSpeedMs;
  const double end_s = body.sounds_until_s + travel_s;
  const double wave = 2.0 * pi * std::max(body.mean_hz, kLowestHz) / bank::kSoundSpeedMs;  // rad/m
  const double limit_m = std::sqrt(facts.thresholds.audible_share) / wave;
  call(body, Effect::kAirDelay, wave * nearest * wave * nearest, end_s, {.rule = Rule::kAirTravel, .value = nearest, .limit = limit_m});
  double moved = 0.0, apart = 0.0;
  for (std::size_t m = 0; m < way_m.size(); ++m) {
    moved = std::max(moved, std::abs(way_m[m] - body.anchor_m[m]));
    apart = std::max(apart, std::abs(way_m[m] - middle_m));
  }
  if (way_m.size() > 1) {
    call(body, Effect::kTwoEars, wave * apart * wave * apart, end_s,
         {.rule = apart > limit_m ? Rule::kOtherWay : Rule::kSameWay, .value = apart, .limit = limit_m});
  }
  // A head changes what each ear hears by decibels, wherever the body is.
  const BodyFacts& of = facts.bodies[static_cast<std::size_t>(&body - bodies.data())];
  if (facts.has_head && !of.overrides.off.has(Effect::kHead)) {
    for (const Effect effect : {Effect::kTwoEars, Effect::kHead}) call(body, effect, 1e30, end_s, {.rule = Rule::kByHead});
  }
  call(body, Effect::kDoppler, wave * moved * wave * moved, time_s + travel_s,
       {.rule = moved > limit_m ? Rule::kMoving : Rule::kStill, .value = moved, .limit = limit_m});
  if (moved > limit_m) body.anchor_m = way_m;
  if (facts.floor && body.possible.has(Effect::kGroundReflection)) reflect(body, time_s);
}

/// What the floor adds to the sound on its straight way.
void EffectSelector::State::reflect(Body& body, double time_s) {
  const synth::Floor& floor = *facts.floor;
  const Vec3 ear = listener.find(time_s).position_m;
  double share = 0.0, farthest_m = 0.0;
  for (std::size_t m = 0; m < way_m.size(); ++m) {
    const Vec3 mirrored = floor.mirror(ear + facts.microphones_m[m]);
    const double distance_m = std::max(calc_norm(mirrored - body.position_m), synth::kNearestM);
    share = std::max(share, std::pow(floor.reflection * way_m[m] / distance_m, 2.0));
    farthest_m = std::max(farthest_m, distance_m);
  }
  call(body, Effect::kGroundReflection, share, body.sounds_until_s + farthest_m / bank::kSoundSpeedMs,
       {.rule = Rule::kReflected, .value = to_db(share), .limit = to_db(facts.thresholds.audible_share)});
}

/// A pulse that comes in pieces is judged by all of it that is known.
void EffectSelector::State::apply(const events::Force& force) {
  Body& body = bodies[static_cast<std::size_t>(force.body)];
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
  apply(*pulse, costs.force_mode_ns + force.count * costs.step_mode_ns, force.calc_length_s());
}

void EffectSelector::State::apply(const events::Impulse& impulse) { apply(impulse, costs.strike_mode_ns, impulse.duration_s); }

/// What a pulse makes to be heard, and how loud it is at the nearest microphone. `projection` holds those of the pulse.
EffectSelector::State::StrikeSound EffectSelector::State::hear(Body& body, const BodyFacts& of, const events::Impulse& impulse) {
  StrikeSound sound;
  sound.time_s = impulse.time_s;
  sound.half_s = 0.5 * impulse.duration_s;
  sound.levels = calc_strike_levels(*body.bank, projection, impulse.shape, impulse.duration_s, amplitude_pa);
  sound.distance_m = find_ways(body, impulse.time_s);
  sound.travel_s = sound.distance_m / bank::kSoundSpeedMs;
  sound.spreading = 1.0 / (sound.distance_m * sound.distance_m);
  if (!of.fixed) sound.click = body.bank->calc_click_levels(calc_norm(impulse.impulse_n_s), impulse.shape, impulse.duration_s);
  const double pushed =
      body.bank->calc_pushed_pa2_s(impulse.triangle, impulse.barycentric, impulse.impulse_n_s, impulse.shape, impulse.duration_s);
  sound.heard = (sound.levels.modal_pa2_s + pushed) * sound.spreading;
  sound.clicked = sound.click.pa2_s * sound.spreading;
  loudest_pa2_s = std::max(loudest_pa2_s, sound.heard + sound.clicked);
  body.ring_pa2_s = std::max(sound.heard, body.ring_pa2_s * std::pow(10.0, -6.0 * std::max(0.0, impulse.time_s - body.ring_s)));
  body.ring_s = impulse.time_s;
  sound.limit_db = calc_inaudible_db();
  sound.modal_db = calc_level_db(sound.heard);
  sound.click_db = calc_level_db(sound.clicked);
  return sound;
}

/// Each mode rings until its part of what is just not heard is all that is left of it. Returns when the last one is silent.
double EffectSelector::State::ring_out(Body& body, const StrikeSound& sound) {
  const double quiet_pa = kReferencePa * std::pow(10.0, sound.limit_db / 20.0) * sound.distance_m /
                          std::sqrt(std::max(1.0, static_cast<double>(amplitude_pa.size())));
  double rung_s = 0.0, end_s = kNever;
  const std::span<const BankLevels::Mode> modes = body.bank->get_modes();
  for (std::size_t m = 0; m < modes.size(); ++m) {
    const double level = amplitude_pa[m] * modes[m].weight / quiet_pa;
    if (!(level > 1.0)) continue;
    const double quiet_s = sound.time_s + std::log(level) / modes[m].decay_per_s;
    end_s = std::max(end_s, quiet_s);
    if (!(quiet_s > body.quiet_s[m])) continue;
    rung_s += std::max(0.0, std::min(quiet_s, facts.duration_s) - std::max(sound.time_s, body.quiet_s[m]));
    body.quiet_s[m] = quiet_s;
  }
  body.plan.effects[Effect::kModal].cost_us += 1e-3 * rung_s * facts.rate_hz * costs.mode_sample_ns;
  return std::max(end_s, sound.time_s + sound.half_s);
}

/// Whether the modes are heard. Returns until when the body sounds by them.
double EffectSelector::State::call_modes(Body& body, const BodyFacts& of, const StrikeSound& sound, double work_ns) {
  // While it sounds, what is not heard of it is played too.
  if (sound.modal_db > sound.limit_db || sound.time_s <= body.sounds_until_s)
    body.plan.effects[Effect::kModal].cost_us += 1e-3 * (costs.event_ns + static_cast<double>(body.bank->get_modes().size()) * work_ns);
  if (!(sound.modal_db > sound.limit_db)) {
    call(body, Effect::kModal, 0.0, kNever, {.rule = Rule::kTooQuiet, .value = sound.modal_db, .limit = sound.limit_db});
    return kNever;
  }
  const double end_s = ring_out(body, sound), share = sound.calc_share(sound.heard);
  const bool counts = share > facts.thresholds.audible_share || of.overrides.off.has(Effect::kAccelerationNoise);
  call(body, Effect::kModal, counts ? 1.0 + sound.heard : share, end_s + sound.travel_s,
       counts ? SelectionReason{.rule = Rule::kHeard, .value = sound.modal_db, .distance_m = sound.distance_m}
              : SelectionReason{.rule = Rule::kChange, .value = to_db(share), .limit = to_db(facts.thresholds.audible_share)});
  if (sound.levels.mean_hz > body.mean_hz) body.mean_hz = sound.levels.mean_hz;
  call_directivity(body, sound, end_s + sound.travel_s);
  return end_s;
}

/// How much the level of what was struck varies over directions: modes by their exposures, `amplitude_pa` of the strike.
void EffectSelector::State::call_directivity(Body& body, const StrikeSound& sound, double until_s) {
  if (!body.possible.has(Effect::kDirectivity)) return;
  if (const double clear_db = sound.limit_db + kDirectionClearDb; !(sound.modal_db > clear_db)) {
    call(body, Effect::kDirectivity, 0.0, kNever,
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
  call_directivity(body, all > 0.0 ? spread / all : body.bank->get_spread_db(), until_s);
}

void EffectSelector::State::call_directivity(Body& body, double spread_db, double until_s) {
  call(body, Effect::kDirectivity, spread_db, until_s,
       {.rule = spread_db > kDirectionDb ? Rule::kDirected : Rule::kSameAllRound, .value = spread_db, .limit = kDirectionDb}, kDirectionDb);
}

/// By how much what strikes have left of swinging raises a coupled mode that swings alone: of q'' + lambda q + 2 a^2 q^3 = 0 with the
/// amplitude q, alpha = 2 a^2 q^2 / lambda, the frequency grows by 3 alpha / 8 to first order. `projection` holds that of the strike.
void EffectSelector::State::call_nonlinear(Body& body, const events::Impulse& impulse, double until_s) {
  if (!body.possible.has(Effect::kNonlinear)) return;
  const bank::Bank& bank = body.bank->get_bank();
  const std::vector<std::int32_t>& coupled = bank.quartic.modes;
  const std::span<const BankLevels::Mode> modes = body.bank->get_modes();
  const double passed_s = std::max(0.0, impulse.time_s - body.swing_s);
  body.swing_s = std::max(body.swing_s, impulse.time_s);
  double cents = 0.0, soft_s = kNever;
  for (std::size_t i = 0, m = 0; i < coupled.size(); ++i) {
    while (m < modes.size() && modes[m].index < coupled[i]) ++m;
    if (m == modes.size() || modes[m].index != coupled[i]) continue;
    const auto mode = static_cast<std::size_t>(coupled[i]);
    const double lambda = bank.eigenvalue_rad2_s2[mode], decay_per_s = std::max(modes[m].decay_per_s, 1e-9);
    const double pulse = calc_pulse_spectrum(impulse.shape, modes[m].freq_hz * impulse.duration_s);
    body.swing[i] = body.swing[i] * std::exp(-decay_per_s * passed_s) + projection[m] * pulse / std::sqrt(lambda);
    const double alpha = 2.0 * body.self[i] * body.swing[i] * body.swing[i] / lambda;
    const double raised = 1200.0 / std::numbers::ln2 * 0.375 * alpha;
    cents = std::max(cents, raised);
    if (raised > kHardeningCents) soft_s = std::max(soft_s, impulse.time_s + std::log(raised / kHardeningCents) / (2.0 * decay_per_s));
  }
  call(body, Effect::kNonlinear, cents, std::min(soft_s, until_s), {.rule = Rule::kHardens, .value = cents, .limit = kHardeningCents},
       kHardeningCents);
  if (!body.possible.has(Effect::kCascade)) return;
  // What has come up stays until it has died away.
  call(body, Effect::kCascade, cents, until_s, {.rule = Rule::kHardens, .value = cents, .limit = kCascadeCents}, kCascadeCents);
}

/// Whether the acceleration noise of a body that is not fixed is heard. Returns until when the body sounds by it.
double EffectSelector::State::call_acceleration_noise(Body& body, const BodyFacts& of, const StrikeSound& sound) {
  if (!(sound.click_db > sound.limit_db)) {
    call(body, Effect::kAccelerationNoise, 0.0, kNever, {.rule = Rule::kTooQuiet, .value = sound.click_db, .limit = sound.limit_db});
    return kNever;
  }
  const double share = sound.clicked / (sound.clicked + body.ring_pa2_s);
  const bool thumps = bank::kSoundSpeedMs / (2.0 * pi * body.bank->get_radius_m()) < kThumpHz;
  const double limit = thumps ? kThumpShare / (1.0 + kThumpShare) : facts.thresholds.audible_share;
  call(body, Effect::kAccelerationNoise, share,
       sound.time_s + sound.half_s + sound.travel_s + 20.0 * body.bank->get_radius_m() / bank::kSoundSpeedMs,
       {.rule = thumps ? Rule::kThump : Rule::kChange, .value = to_db(share), .limit = to_db(limit), .distance_m = sound.click_db}, limit);
  if (!(share > limit) || of.overrides.off.has(Effect::kAccelerationNoise)) return kNever;
  body.mean_hz = std::max(body.mean_hz, sound.click.mean_hz);
  return sound.time_s + sound.half_s;
}

/// What it costs that has not been counted: `work_ns` for each mode, and a pulse for the time `new_s`.
void EffectSelector::State::apply(const events::Impulse& impulse, double work_ns, double new_s) {
  Body& body = bodies[static_cast<std::size_t>(impulse.body)];
  const BodyFacts& of = facts.bodies[static_cast<std::size_t>(impulse.body)];
  if (!body.bank->calc_projections(impulse.triangle, impulse.barycentric, impulse.impulse_n_s, projection)) return;
  const StrikeSound sound = hear(body, of, impulse);
  double end_s = call_modes(body, of, sound, work_ns);
  if (end_s != kNever) call_nonlinear(body, impulse, end_s + sound.travel_s);
  if (!of.fixed) end_s = std::max(end_s, call_acceleration_noise(body, of, sound));
  if (end_s == kNever) {
    call(body, Effect::kHertzPulse, 0.0, kNever, {.rule = Rule::kTooQuiet, .value = sound.modal_db, .limit = sound.limit_db});
    return;
  }
  // What an impulse without length would add, and to acceleration noise all that its pulse takes away.
  const double lost = sound.calc_share((sound.levels.pulse_loss_pa2_s + sound.click.pulse_loss_pa2_s) * sound.spreading);
  call(body, Effect::kHertzPulse, lost, end_s + sound.travel_s,
       {.rule = Rule::kChange, .value = to_db(lost), .limit = to_db(facts.thresholds.audible_share)});
  if (lost > facts.thresholds.audible_share) {
    body.plan.effects[Effect::kHertzPulse].cost_us +=
        1e-3 * static_cast<double>(amplitude_pa.size()) *
        (costs.pulse_mode_sample_ns * new_s * facts.rate_hz + (new_s < impulse.duration_s ? 0.0 : costs.pulse_mode_ns));
  }
  body.sounds_until_s = std::max(body.sounds_until_s, end_s);
  look(body, impulse.time_s);
}

/// The surfaces of a contact with their moduli: of the body that the record is for, and the other one.
std::array<synth::ContactSurface, 2> EffectSelector::State::find_surfaces(const events::LastingContact& contact) const {
  const BodyFacts& of = facts.bodies[static_cast<std::size_t>(contact.body)];
  const bool has_other = contact.other >= 0 && static_cast<std::size_t>(contact.other) < facts.bodies.size();
  const auto complete = [](const BodyFacts& body) {
    const bank::Material& m = body.bank->material;
    return synth::complete(body.surface, m.young_modulus_pa / (1.0 - m.poisson_ratio * m.poisson_ratio), bank::calc_wave_impedance(m));
  };
  const synth::ContactSurface own = complete(of);
  synth::ContactSurface other = facts.ground;
  if (has_other) other = complete(facts.bodies[static_cast<std::size_t>(contact.other)]);
  return {own, other};
}

/// What a lasting contact adds to the mean square of each mode's velocity a second: a quarter of the density of its force.
void EffectSelector::State::find_power(const Body& body, const events::LastingContact& contact, std::vector<double>& power) {
  const std::span<const BankLevels::Mode> modes = body.bank->get_modes();
  power.assign(modes.size(), 0.0);
  const auto [own, other] = find_surfaces(contact);
  const synth::ContactNoise noise = synth::calc_contact_noise(contact, own, other, facts.rate_hz);
  if (!(noise.decay_length_m > 0.0)) return;
  const double drag = noise.sliding * std::sqrt(own.friction * other.friction), slip = calc_norm(contact.slip_m_s);
  Vec3 along = contact.normal;
  for (std::size_t k = 0; k < 3 && slip > 0.0; ++k) along[k] -= drag / slip * contact.slip_m_s[k];
  if (!body.bank->calc_projections(contact.triangle, contact.barycentric, along, projection)) return;
  for (std::size_t m = 0; m < modes.size(); ++m)
    power[m] = 0.25 * synth::calc_density(noise, contact.force_n, modes[m].freq_hz) * projection[m] * projection[m];
}

/// The ring of the modes that a contact drives, up to this record, and then until it is not heard any more: when that is, at the body. It
/// is looked at every kRingS only and where the contact rests or ends.
double EffectSelector::State::ring(Body& body, const events::LastingContact& contact) {
  const double speed_m_s = std::max({contact.sweep_m_s, contact.other_sweep_m_s, calc_norm(contact.slip_m_s)});
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
  find_power(body, driving->strongest, power);
  if (drives)
    *driving = {contact.id, contact.time_s, size, contact, contact};
  else
    body.driving.erase(driving);

  const std::span<const BankLevels::Mode> modes = body.bank->get_modes();
  const double distance = find_ways(body, contact.time_s), passed_s = std::max(0.0, contact.time_s - body.ring_at_s);
  body.ring_at_s = std::max(body.ring_at_s, contact.time_s);
  body.ring_m2_s2.resize(modes.size());
  double steady_pa2 = 0.0;
  for (std::size_t m = 0; m < modes.size(); ++m) {
    const double d = modes[m].decay_per_s;
    double& ring = body.ring_m2_s2[m];
    ring = ring * std::exp(-2.0 * d * passed_s) - power[m] * std::expm1(-2.0 * d * gap_s) / (2.0 * d);
    steady_pa2 += ring * std::pow(modes[m].gain_pa * modes[m].weight / distance, 2.0);
  }
  loudest_pa2_s = std::max(loudest_pa2_s, steady_pa2 * kEarS);
  if (!(loudest_pa2_s > 0.0)) return kNever;
  const double quiet_pa =
      kReferencePa * std::pow(10.0, calc_inaudible_db() / 20.0) * distance / std::sqrt(std::max(1.0, static_cast<double>(modes.size())));
  double end_s = kNever, rung_s = 0.0;
  for (std::size_t m = 0; m < modes.size(); ++m) {
    const double level = kChance * std::sqrt(2.0 * body.ring_m2_s2[m]) * modes[m].gain_pa * modes[m].weight / quiet_pa;
    if (!(level > 1.0)) continue;
    const double quiet_s = contact.time_s + std::log(level) / modes[m].decay_per_s;
    end_s = std::max(end_s, quiet_s);
    if (!(quiet_s > body.quiet_s[m])) continue;
    rung_s += std::max(0.0, std::min(quiet_s, facts.duration_s) - std::max(contact.time_s, body.quiet_s[m]));
    body.quiet_s[m] = quiet_s;
  }
  body.plan.effects[Effect::kModal].cost_us += 1e-3 * rung_s * facts.rate_hz * costs.mode_sample_ns;
  return end_s;
}

/// What a contact that moves calls for until then. Whether it does.
bool EffectSelector::State::offer(Body& body, const events::LastingContact& contact, double time_s) {
  const double slip = calc_norm(contact.slip_m_s);
  const double sweep = std::max(contact.sweep_m_s, contact.other_sweep_m_s);
  const bool presses = contact.force_n > 0.0;
  const auto offer = [&](Effect effect, double speed) {
    const bool goes = presses && speed > kCreepMs;
    call(body, effect, goes ? 1.0 + speed : 0.0, time_s, {.rule = goes ? Rule::kSlip : Rule::kNoSlip, .value = speed, .limit = kCreepMs});
    return goes;
  };
  // Of the movement over the surfaces so much is slip (docs/decisions/contact-sound.md); the rest is rolling.
  const double sliding = sweep > slip ? slip / sweep : 1.0;
  const bool slides = offer(Effect::kRoughness, std::min(slip, sweep)), rolls = offer(Effect::kRolling, sweep * (1.0 - sliding));
  if (slides || rolls) {
    call(body, Effect::kModal, 1.0, time_s, {.rule = Rule::kSlip, .value = std::max(slip, sweep), .limit = kCreepMs});
    call_directivity(body, body.bank->get_spread_db(), time_s);
    body.sounds_until_s = std::max(body.sounds_until_s, time_s + kHoldS);
    body.driven_until_s = time_s + kRecordGapS;
    if (body.mean_hz == 0.0) body.mean_hz = 4000.0;  // where a mean frequency is not known the ear is at its best
    look(body, time_s);
  }
  return slides || rolls;
}

void EffectSelector::State::apply(const events::LastingContact& contact) {
  Body& body = bodies[static_cast<std::size_t>(contact.body)];
  std::erase_if(body.lasting, [&](const Body::Lasting& one) { return one.id == contact.id; });
  // Without a strike nothing else says how loud the modes are when the contact lets them go.
  if (const double end_s = ring(body, contact); end_s > contact.time_s) {
    call(body, Effect::kModal, 1.0, end_s + find_ways(body, contact.time_s) / bank::kSoundSpeedMs,
         {.rule = Rule::kSlip, .value = calc_norm(contact.slip_m_s), .limit = kCreepMs});
    call_directivity(body, body.bank->get_spread_db(), end_s + find_ways(body, contact.time_s) / bank::kSoundSpeedMs);
    body.sounds_until_s = std::max(body.sounds_until_s, end_s);
    look(body, contact.time_s);
  }
  if (contact.state == events::ContactState::kEnd) return;
  const bool moves = offer(body, contact, contact.time_s);
  if (!body.possible.has(Effect::kContactDamping)) return;
  const auto [own, other] = find_surfaces(contact);
  const double impedance = synth::find_impedance(contact, other);
  if (!(impedance > 0.0)) return;
  // A dashpot z at the point adds z (phi . n)^2 / 2 to a decay; a decay that is wrong by the part e changes an exposure by e^2 / 2.
  if (!body.bank->calc_projections(contact.triangle, contact.barycentric, contact.normal, projection)) return;
  double max = 0.0, sounding = 0.0;
  const synth::ContactSpring spring = synth::calc_contact_spring(contact.patch_radius_m, own.modulus_pa, other.modulus_pa);
  const std::span<const BankLevels::Mode> modes = body.bank->get_modes();
  for (std::size_t m = 0; m < modes.size(); ++m) {
    const double taken = 0.5 * impedance * projection[m] * projection[m] +
                         synth::calc_spring_loss(spring, 2.0 * std::numbers::pi * modes[m].freq_hz, projection[m]);
    const double part = taken / modes[m].decay_per_s;
    max = std::max(max, part);
    if (moves || body.quiet_s[m] >= contact.time_s) sounding = std::max(sounding, part);
  }
  const auto calc_share = [](double part) { return std::min(1.0, 0.5 * part * part); };
  body.lasting.push_back({contact.id, calc_share(max)});
  if (contact.time_s <= body.sounds_until_s) damp(body, calc_share(sounding), contact.time_s);
}

void EffectSelector::State::damp(Body& body, double share, double time_s) {
  call(body, Effect::kContactDamping, share, time_s,
       {.rule = Rule::kChange,
        .value = 10.0 * std::log10(std::max(share, 1e-30)),
        .limit = 10.0 * std::log10(facts.thresholds.audible_share)});
}

void EffectSelector::State::apply(const Pending& next) {
  if (const auto* impulse = std::get_if<events::Impulse>(&next.event)) apply(*impulse);
  if (const auto* force = std::get_if<events::Force>(&next.event)) apply(*force);
  if (const auto* contact = std::get_if<events::LastingContact>(&next.event)) apply(*contact);
  if (const auto* motion = std::get_if<events::BodyMotion>(&next.event)) {
    Body& body = bodies[static_cast<std::size_t>(motion->body)];
    body.position_m = motion->position_m;
    look(body, motion->time_s);
  }
}

EffectSet EffectSelector::State::decide(const BodyFacts& of, Body& body, double time_s) const {
  EffectSet set = of.overrides.on;
  if (of.overrides.automatic) {
    for (const Effect effect : EffectSet::all()) {
      const auto base = find_base(effect);
      if (of.overrides.on.has(effect) && base) set = set.with(*base);  // what is forced on brings what it acts on
      if (body.until_s[effect] + kHoldS >= time_s) set = set.with(effect);
    }
  }
  set = set.without(of.overrides.off);
  if (!of.overrides.automatic) return set;
  for (const Effect effect : EffectSet::all()) {
    const auto base = find_base(effect);
    if (base && !set.has(*base) && !of.overrides.on.has(effect)) set = set.without(effect);
  }
  if (!set.has(Effect::kModal) && !set.has(Effect::kAccelerationNoise)) {
    for (const Effect effect :
         {Effect::kHertzPulse, Effect::kAirDelay, Effect::kDoppler, Effect::kTwoEars, Effect::kGroundReflection, Effect::kHead}) {
      if (!of.overrides.on.has(effect)) set = set.without(effect);
    }
  }
  return set;
}

/// For one tick with the effects that the body now has.
void EffectSelector::State::add_costs(Body& body) {
  const double time_s = static_cast<double>(tick) * kTickS;
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
  // Every ear sounds the modes by itself, twice where its weights change, which then are looked up once a block.
  add(Effect::kDirectivity,
      ears * reflected * modes * (moves ? 2.0 * costs.mode_sample_ns + costs.transfer_ns / synth::kBlock : costs.mode_sample_ns));
  add(Effect::kNonlinear, body.coupling_ns);
  add(Effect::kCascade, body.cascade_ns);
  add(Effect::kAccelerationNoise, ears * costs.dipole_ear_sample_ns + costs.click_sample_ns);
  // What modes cost that a contact drives is in the first of its effects, as it is where it is measured.
  double driven_ns = kDrivenModeSampleNs * static_cast<double>(body.bank->get_modes().size());
  for (const Effect effect : kContactEffects) {
    if (time_s > body.driven_until_s) break;
    add(effect, std::max(1.0, static_cast<double>(body.driving.size())) * (costs.force_sample_ns + kContactSampleNs + driven_ns));
    if (body.now.has(effect)) driven_ns = 0.0;
  }
}

EffectSet EffectSelector::get_possible(int body) const {
  const auto i = static_cast<std::size_t>(body);
  const EffectOverrides& overrides = state_->facts.bodies.at(i).overrides;
  const EffectSet offered = overrides.automatic ? state_->bodies[i].possible.with(overrides.on) : overrides.on;
  return offered.without(overrides.off);
}

bool EffectSelector::needs_contacts() const {
  for (std::size_t i = 0; i < state_->bodies.size(); ++i) {
    const EffectSet possible = get_possible(static_cast<int>(i));
    if (state_->facts.moves && possible.has_any(kContactEffects)) return true;
  }
  return false;
}

void EffectSelector::watch(const events::Event& event) {
  State& s = *state_;
  double from_s = events::get_time_s(event);
  const auto is_ours = [&](std::int32_t body) { return body >= 0 && static_cast<std::size_t>(body) < s.bodies.size(); };
  if (events::find_fault(event) != nullptr) return;
  if (const auto* impulse = std::get_if<events::Impulse>(&event)) {
    if (!is_ours(impulse->body)) return;
    const double lead = s.bodies[static_cast<std::size_t>(impulse->body)].bank->get_radius_m() / bank::kSoundSpeedMs;
    from_s -= 0.5 * synth::calc_pulse_length(impulse->shape, impulse->duration_s) + lead;
  } else if (const auto* force = std::get_if<events::Force>(&event)) {
    if (!is_ours(force->body)) return;
    from_s -= s.bodies[static_cast<std::size_t>(force->body)].bank->get_radius_m() / bank::kSoundSpeedMs;
  } else if (const auto* contact = std::get_if<events::LastingContact>(&event)) {
    if (!is_ours(contact->body)) return;
  } else if (const auto* motion = std::get_if<events::BodyMotion>(&event)) {
    if (!is_ours(motion->body)) return;
  } else if (const auto* listener = std::get_if<events::Listener>(&event)) {
    if (!std::exchange(s.has_walk, true)) s.begin_walk(listener->time_s);
    s.listener.push({listener->time_s, listener->position_m, listener->velocity_m_s});
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
    const double time_s = static_cast<double>(s.tick) * kTickS, seen_s = time_s + kTickS + s.facts.thresholds.lead_s;
    if (!(time_s <= s.facts.duration_s) || !(seen_s <= known_s)) break;
    while (!s.pending.empty() && s.pending.top().from_s <= seen_s) {
      s.apply(s.pending.top());
      s.pending.pop();
    }
    for (std::size_t i = 0; i < s.bodies.size(); ++i) {
      State::Body& body = s.bodies[i];
      if (!s.listener.is_still()) s.look(body, seen_s);
      for (const State::Body::Driving& one : body.driving) s.offer(body, one.last, seen_s);
      if (seen_s <= body.sounds_until_s) {
        for (const State::Body::Lasting& one : body.lasting) s.damp(body, one.share, seen_s);
      }
      const BodyFacts& of = s.facts.bodies[i];
      const EffectSet set = s.decide(of, body, time_s);
      if (set != body.now || !body.decided) {
        EffectChange change{time_s, static_cast<int>(i), set, {}};
        for (const Effect effect : EffectSet::all()) {
          const bool on = set.has(effect);
          if (body.decided && on == body.now.has(effect)) continue;
          EffectPlan& plan = body.plan.effects[effect];
          if (on && !plan.ever) plan.first_s = time_s;
          plan.ever = plan.ever || on;
          plan.switched += on;
          const bool forced = !of.overrides.automatic || of.overrides.on.has(effect) || of.overrides.off.has(effect);
          SelectionReason reason = on ? body.call[effect] : body.decided ? SelectionReason{.rule = Rule::kSilent} : body.reason[effect];
          if (forced) reason = {.rule = of.overrides.automatic || on ? Rule::kForced : Rule::kNotOffered};
          change.switches.push_back({effect, on, reason});
        }
        body.now = set;
        body.decided = true;
        changes.push_back(std::move(change));
      }
      for (const Effect effect : set) {
        EffectPlan& plan = body.plan.effects[effect];
        plan.last_s = std::min(time_s + kTickS, s.facts.duration_s);
        plan.on_s += std::max(0.0, plan.last_s - time_s);
      }
      s.add_costs(body);
    }
  }
  return changes;
}

double EffectSelector::get_time_s() const { return static_cast<double>(state_->tick) * kTickS; }

BodyPlan EffectSelector::get_plan(int number) const {
  const auto i = static_cast<std::size_t>(number);
  const State::Body& body = state_->bodies.at(i);
  const EffectOverrides& overrides = state_->facts.bodies[i].overrides;
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
    if (of.ever && of.reason.rule == Rule::kNotStruck) of.reason = {.rule = Rule::kForced};  // brought along
  }
  return plan;
}

double EffectSelector::calc_silence_pa(int number) const {
  constexpr double kStandardPa = 1e-10;  // of VoiceOptions
  constexpr double kMargin = 0.5;        // of what is not heard: bodies come nearer, and modes add up
  const State::Body& body = state_->bodies.at(static_cast<std::size_t>(number));
  if (!(state_->loudest_pa2_s > 0.0)) return kStandardPa;
  const double quiet_pa = kReferencePa * std::pow(10.0, state_->calc_inaudible_db() / 20.0);
  return std::max(kStandardPa, kMargin * quiet_pa * body.nearest_m);
}

}  // namespace carillon::effect_selection
