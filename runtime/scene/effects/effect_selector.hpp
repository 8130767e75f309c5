// The effects of each body and their reasons, from the scene before any motion and from its events as they come.
//
//   effects::EffectSelector selector(facts);                           // bodies, listener, overrides of the scene
//   for (const events::Event& event : events) selector.watch(event);
//   for (const effects::EffectChange& change : selector.advance(known_until_s)) changes.push_back(change);
//   ... synthesiser.set_effects(change.body, change.effects) when the sound gets to change.time_s
//
// One thread at a time, never an audio thread: it allocates.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "runtime/scene/effects/costs.hpp"
#include "runtime/scene/effects/levels.hpp"
#include "runtime/events/events.hpp"
#include "runtime/synth/contact_forces.hpp"
#include "runtime/synth/effects.hpp"
#include "runtime/synth/floor.hpp"
#include "runtime/synth/trajectory.hpp"

namespace carillon::effects {

using synth::Effect;
using synth::EffectSet;

/// The one threshold that all rules share: an effect is called for when leaving it out would change the body's A-weighted sound by more
/// than this share of its exposure, -50 dB. Errors of several effects and bodies then stay below -40 dB together.
inline constexpr double kAudibleShare = 1e-5;
/// A sphere of more than 18 cm rings below this frequency, c / 2 pi a, when it is pushed: no click, but a thump where the body's own low
/// modes are, which is heard as one with their onset. It is called for when it raises their level by 1 dB, the least that is heard
/// (Jesteadt, Wier & Green 1977).
inline constexpr double kThumpHz = 300.0;
inline constexpr double kThumpShare = 0.259;
/// Inaudible: below 0 dB(A), the threshold of the best ears (ISO 389-7 has -6 dB at its lowest, 2.4 dB at 1 kHz), and 70 dB below
/// the loudest strike so far as well, since files are played louder than life: at 90 dB(A) that is 20 dB(A), less than a quiet room has.
inline constexpr double kInaudibleDb = 0.0;
inline constexpr double kBelowLoudestDb = 70.0;
/// Directivity is called for when the level of its modes varies over directions by so much (standard deviation, dB, each mode by its part
/// of the exposure), the least that is heard, and the body is more than kDirectionClearDb above the inaudible level.
inline constexpr double kDirectionDb = 1.0;
inline constexpr double kDirectionClearDb = 10.0;
/// Nonlinear motion is called for when a strike makes a coupled mode stiffer by so much, the least that is heard of a lone tone.
inline constexpr double kHardeningCents = 3.0;
/// The cascade above the coupled modes is called for when a strike makes a coupled mode stiffer by so much: some 0.6 of the thickness of a
/// plate. Chosen, not measured: the flux grows as the third power of the energy (docs/decisions/cascade.md).
inline constexpr double kCascadeCents = 300.0;
/// Slower than this nothing slides or rolls: synth::ContactForces gives no force then.
inline constexpr double kCreepMs = 2e-4;
/// A ring that a lasting contact drives is random: its amplitude is this much above its root mean square at times.
inline constexpr double kChance = 4.0;
/// An effect is on this long before it is needed, so that a change that is still on its way to the ears is over; and stays on for so long
/// after.
inline constexpr double kLeadS = 0.05;
inline constexpr double kHoldS = 0.25;
/// Decisions are made on this grid of time.
inline constexpr double kTickS = 0.01;

/// The thresholds of a selector; their initialisers are the choice of docs/accuracy.md.
struct SelectionThresholds {
  double audible_share = kAudibleShare;       // of a body's exposure: smaller changes are left out
  double below_loudest_db = kBelowLoudestDb;  // of the loudest strike: inaudible so far below it and below kInaudibleDb
  double lead_s = kLeadS;                     // an effect is on this long before it is needed
};

/// The scene's own choice of effects of a body. `on` and `off` have nothing in common.
struct EffectOverrides {
  bool automatic = true;  // the selector decides on all others; false: they are off
  EffectSet on{}, off{};
};

struct BodyFacts {
  std::string name;
  const bank::Bank* bank = nullptr;  // with the gains that it is played with; must outlive the selector
  double sphere_radius_m = 0.0;      // radiation::calc_sphere_radius_m(*bank); 0: to be worked out
  /// Of the bank's multipoles; nullptr: to be made. Looked at in the constructor only.
  std::shared_ptr<const radiation::Transfers> transfers = nullptr;
  bool fixed = false;
  bool struck = false;  // by the scene itself
  Vec3 position_m{};    // of the centre of mass, at the beginning
  EffectOverrides overrides{};
  synth::ContactSurface surface{};
};

struct SceneFacts {
  double rate_hz = 48000.0;
  double duration_s = std::numeric_limits<double>::infinity();
  std::vector<BodyFacts> bodies;
  bool moves = true;                           // some body may move, and so touch others
  std::vector<Vec3> microphones_m;             // from the listener, a channel each
  std::vector<synth::PathPoint> listener{{}};  // its way, as far as it is known; at least one place
  SelectionThresholds thresholds{};
  synth::ContactSurface ground = synth::kGroundSurface;
  std::optional<synth::Floor> floor{};  // that reflects
  bool has_head = false;                // the listener, in the middle of two microphones
};

/// The rule of a decision, and its numbers.
struct SelectionReason {
  enum class Rule : std::uint8_t {
    kForced,      // by the scene
    kNotOffered,  // the scene gives a list without it
    kNeedsOther,  // an effect on which it depends is off; `other`
    kNotStruck,   // nothing has happened to the body
    kNoModes,     // none that is heard
    kTooQuiet,    // value: level [dB(A)], limit
    kHeard,       // value: level [dB(A)], distance [m]
    kSilent,      // it has died away
    kChange,      // value: the change that leaving it out makes [dB], limit: kAudibleShare in dB
    kThump,       // value: its share of the sound [dB], limit: kThumpShare in dB
    kFixed,       // cannot be accelerated
    kOneMicrophone,
    kStill,  // value: the farthest that its way to a microphone changed [m], limit [m]
    kMoving,
    kSameWay,  // value: the largest difference of a way to a microphone from the way to their middle [m], limit [m]
    kOtherWay,
    kNoContact,  // no contact lasts
    kNoSlip,     // value: speed [m/s], limit
    kSlip,
    kAirTravel,     // value: distance [m]
    kNoMultipoles,  // none in the bank
    kSameAllRound,  // value: standard deviation of the level over directions [dB], limit
    kDirected,      // the same
    kFaint,         // value: level [dB(A)], limit: of audible directions, distance [m]
    kNoFloor,       // none that reflects
    kReflected,     // value: level of the reflection [dB], limit
    kNoHead,        // of the listener's
    kByHead,        // the body is heard, and by a head
    kNoEnergy,      // no nonlinear energy in the bank
    kHardens,       // value: rise of a coupled mode by the strike [cent], limit
    kNothingAbove   // the bank has no modes above the coupled ones, or does not say its mass or thickness
  };
  Rule rule = Rule::kNotStruck;
  double value = 0.0, limit = 0.0, distance_m = 0.0;
  Effect other = Effect::kModal;
};

/// As a sentence without a full stop: "leaving it out would change the sound by -23.1 dB, more than -50 dB".
std::string describe(const SelectionReason& reason);

/// One effect that is switched on or off, and why.
struct EffectSwitch {
  Effect effect = Effect::kModal;
  bool on = false;
  SelectionReason reason;
};

/// From `time_s` on a body has these effects. The first of a body lists all of them, later ones the changes.
struct EffectChange {
  double time_s = 0.0;
  int body = 0;
  EffectSet effects;
  std::vector<EffectSwitch> switches;
};

/// An effect of a body over the whole scene so far.
struct EffectPlan {
  bool ever = false;                   // it was on at some time
  double on_s = 0.0;                   // for so long
  double first_s = 0.0, last_s = 0.0;  // from, until
  int switched = 0;                    // times that it was switched on
  SelectionReason reason;              // of the loudest call for it, or else of their absence
  double cost_us = 0.0;                // CPU time that it will take, all together
};

struct BodyPlan {
  synth::PerEffect<EffectPlan> effects;
  const EffectPlan& operator[](Effect effect) const { return effects[effect]; }
};

/// Decides on the effects of each body, on a grid of kTickS. A decision is final: it uses only events up to lead_s after its time, and does
/// not depend on the division of time into calls of advance().
class EffectSelector {
 public:
  /// Throws InputError when a body has no bank, or arrays of a bank disagree.
  explicit EffectSelector(SceneFacts facts, const Costs& costs = {});
  ~EffectSelector();
  EffectSelector(EffectSelector&&) noexcept;

  /// All effects that a body may call for, by the scene before any motion: banks, places, the listener's path, overrides.
  EffectSet get_possible(int body) const;
  /// True when a plan may depend on lasting contacts, which the physics has to record then.
  bool needs_contacts() const;

  /// Events in order of their time, of the bodies by their index; others are not looked at.
  void watch(const events::Event& event);

  /// Decides for all times up to SelectionThresholds::lead_s before `known_s`: nothing earlier will be watched from now on. Changes in
  /// order of time; the first call gives one for every body.
  std::vector<EffectChange> advance(double known_s);

  double get_time_s() const;  // up to which it has decided
  BodyPlan get_plan(int body) const;
  /// Below this pressure at 1 m [Pa] a body is inaudible at all microphones, by the events so far.
  double calc_silence_pa(int body) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace carillon::effects
