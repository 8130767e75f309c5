// Chooses the effects of each body from the scene and its events, and gives the reasons.
//
//   effects::EffectSelector selector(facts);                           // bodies, listener, overrides of the scene
//   for (const events::Event& event : events) selector.watch(event);
//   selector.advance(infinity);
//   synthesiser.add_body(model, {.effects = selector.choose(body)});
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

#include "runtime/events/events.hpp"
#include "runtime/scene/effects/levels.hpp"
#include "runtime/synth/contact_forces.hpp"
#include "runtime/synth/effects.hpp"
#include "runtime/synth/floor.hpp"
#include "runtime/synth/trajectory.hpp"

namespace carillon::effects {

using synth::Effect;
using synth::EffectSet;

/// Threshold of all rules: an effect is on if leaving it out would change the body's A-weighted sound by more than this share of its
/// exposure, -50 dB. Errors of several effects and bodies then stay below -40 dB together.
inline constexpr double kAudibleShare = 1e-5;
/// Acceleration noise of spheres larger than 18 cm lies below this frequency, c / 2 pi a: a thump at the body's own low modes, heard as one
/// with their onset. It is on if it raises their level by 1 dB, the least audible difference (Jesteadt, Wier & Green 1977).
inline constexpr double kThumpHz = 300.0;
inline constexpr double kThumpShare = 0.259;
/// Inaudible: below 0 dB(A), the threshold of the best ears (ISO 389-7 has -6 dB at its lowest, 2.4 dB at 1 kHz), and 70 dB below the
/// loudest strike so far, since files are played louder than life: at 90 dB(A) that is 20 dB(A), less than a quiet room.
inline constexpr double kInaudibleDb = 0.0;
inline constexpr double kBelowLoudestDb = 70.0;
/// Directivity is on if the level of the modes varies over directions by this standard deviation [dB] (exposure-weighted mean), the least
/// audible difference, and the body is more than kDirectionClearDb above the inaudible level.
inline constexpr double kDirectionDb = 1.0;
inline constexpr double kDirectionClearDb = 10.0;
/// Nonlinear motion is on if a strike raises the frequency of a coupled mode by this much, the least audible difference of a lone tone.
inline constexpr double kHardeningCents = 3.0;
/// The cascade is on if a strike raises the frequency of a coupled mode by this much: a deflection of about 0.6 plate thicknesses. Chosen,
/// not measured: the flux grows as the third power of the energy (docs/decisions/cascade.md).
inline constexpr double kCascadeCents = 300.0;
/// Speed below which nothing slides or rolls: synth::ContactForces gives no force.
inline constexpr double kCreepMs = 2e-4;
/// Peak factor of a ring that a lasting contact drives.
inline constexpr double kPeakFactor = 4.0;
/// Time grid on which continuous motions and contacts are judged.
inline constexpr double kTickS = 0.01;

/// Thresholds of a selector; the defaults are justified in docs/accuracy.md.
struct SelectionThresholds {
  double audible_share = kAudibleShare;       // share of a body's exposure; smaller changes are left out
  double below_loudest_db = kBelowLoudestDb;  // inaudible level relative to the loudest strike, if also below kInaudibleDb
};

/// The scene's own choice of effects of a body. `on` and `off` are disjoint.
struct EffectOverrides {
  bool automatic = true;  // the selector decides on all others; false: they are off
  EffectSet on{}, off{};
};

struct BodyFacts {
  std::string name;
  const bank::Bank* bank = nullptr;  // with the gains that are played; must outlive the selector
  double sphere_radius_m = 0.0;      // radiation::calc_sphere_radius_m(*bank); 0: computed by the selector
  /// Transfers of the bank's multipoles; nullptr: computed by the selector. Used in the constructor only.
  std::shared_ptr<const radiation::Transfers> transfers = nullptr;
  bool fixed = false;
  bool struck = false;  // by strikes of the scene file
  Vec3 position_m{};    // initial centre of mass
  EffectOverrides overrides{};
  synth::ContactSurface surface{};
};

struct SceneFacts {
  double rate_hz = 48000.0;
  double duration_s = std::numeric_limits<double>::infinity();
  std::vector<BodyFacts> bodies;
  bool moves = true;                           // bodies that are not fixed may move and touch others
  std::vector<Vec3> microphones_m;             // offsets from the listener, one per channel
  std::vector<synth::PathPoint> listener{{}};  // known path, at least one point
  SelectionThresholds thresholds{};
  synth::ContactSurface ground = synth::kGroundSurface;
  std::optional<synth::Floor> floor{};  // that reflects
  bool has_head = false;                // in the middle of two microphones
};

/// Rule of a decision, and its numbers.
struct SelectionReason {
  enum class Rule : std::uint8_t {
    kForced,      // by the scene
    kNotOffered,  // not in the scene's list
    kNeedsOther,  // an effect on which it depends is off: `other`
    kNotStruck,   // no event for the body
    kNoModes,     // no audible mode
    kTooQuiet,    // value: level [dB(A)], limit
    kHeard,       // value: level [dB(A)], distance [m]
    kChange,      // value: change by leaving it out [dB], limit: kAudibleShare in dB
    kThump,       // value: its share of the sound [dB], limit: kThumpShare in dB
    kFixed,       // fixed bodies are not accelerated
    kOneMicrophone,
    kStill,  // value: largest change of the distance to a microphone [m], limit [m]
    kMoving,
    kSameWay,  // value: largest difference of a microphone's distance from the distance of their middle [m], limit [m]
    kOtherWay,
    kNoContact,  // no lasting contact
    kNoSlip,     // value: speed [m/s], limit
    kSlip,
    kAirTravel,     // value: distance [m]
    kNoMultipoles,  // none in the bank
    kSameAllRound,  // value: standard deviation of the level over directions [dB], limit
    kDirected,      // the same
    kFaint,         // value: level [dB(A)], limit: level of audible directions, distance [m]
    kNoFloor,       // no reflecting floor
    kReflected,     // value: level of the reflection [dB], limit
    kNoHead,        // the listener has no head
    kByHead,        // audible, and the listener has a head
    kNoEnergy,      // no nonlinear energy in the bank
    kHardens,       // value: rise of a coupled mode by the strike [cent], limit
    kNothingAbove   // no modes above the coupled ones, no mass or no thickness in the bank
  };
  Rule rule = Rule::kNotStruck;
  double value = 0.0, limit = 0.0, distance_m = 0.0;
  Effect other = Effect::kModal;
};

/// A sentence without a full stop: "leaving it out would change the sound by -23.1 dB, more than -50 dB".
std::string describe(const SelectionReason& reason);

/// Decision on one effect of a body.
struct EffectPlan {
  bool on = false;
  SelectionReason reason;  // of its loudest call; without a call, why there was none
};
using BodyPlan = synth::PerEffect<EffectPlan>;

/// Chooses the effects of each body over all events watched. The result does not depend on how time is divided into calls of advance().
class EffectSelector {
 public:
  /// Throws InputError for a body without a bank and for a bank whose arrays disagree.
  explicit EffectSelector(SceneFacts facts);
  ~EffectSelector();
  EffectSelector(EffectSelector&&) noexcept;

  /// All effects that a body may get, by the scene before any event: banks, positions, the listener's path, overrides.
  EffectSet get_possible(int body) const;
  /// True if a choice may depend on lasting contacts, which the physics must then record.
  bool needs_contacts() const;

  /// Events in order of time; those of other bodies are ignored.
  void watch(const events::Event& event);

  /// Judges all events before `known_s`; no earlier event may follow.
  void advance(double known_s);

  /// Effects of a body by the events so far.
  EffectSet choose(int body) const;
  BodyPlan get_plan(int body) const;
  /// Pressure at 1 m [Pa] below which a body is inaudible at all microphones, by the events so far.
  double calc_silence_pa(int body) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace carillon::effects
