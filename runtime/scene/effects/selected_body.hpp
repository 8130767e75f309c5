// One body of an EffectSelector: the calls for its effects, and the sound on which they rest.
#pragma once

#include <cstdint>
#include <vector>

#include "runtime/scene/effects/effect_selector.hpp"
#include "runtime/scene/effects/hearing.hpp"

namespace carillon::effects {

/// Invariant: until_s of an effect is the last time of its calls; `reason` belongs to the loudest, `call_reason` to the last.
struct SelectedBody {
  /// Throws InputError where arrays of the bank disagree.
  SelectedBody(const BodyFacts& of, const BankLevels& levels, Hearing& hearing);

  /// Excludes an effect for this reason.
  void refuse(Effect effect, const SelectionReason& reason);
  /// A call until then for an effect that makes this share of the sound; it counts above the limit, the threshold of all rules or another.
  void call(Effect effect, double share, double until_s, const SelectionReason& reason);
  void call(Effect effect, double share, double until_s, const SelectionReason& reason, double limit);
  /// A call for directivity by the standard deviation of the level over directions.
  void call_directivity(double spread_db, double until_s);
  /// Calls for the effects of propagation at that time.
  void call_propagation(Hearing& hearing, double time_s);
  /// The ring of the modes from then on, each at so many times the level that is not heard; its cost. Returns the time when the last one is
  /// silent; kNever without ring.
  double ring_out(const Hearing& hearing, double time_s, const std::vector<double>& levels);

  const BodyFacts* facts;
  const BankLevels* bank;
  EffectSet possible;
  Vec3 position_m{};
  double audible_share = kAudibleShare;
  double nearest_m = 0.0;                 // to a microphone, so far
  double sounds_until_s = kNever;         // at the body
  double driven_until_s = kNever;         // by contacts that slide or roll; others cost next to nothing
  double mean_hz = 0.0;                   // of its audible sound
  double ring_pa2_s = 0.0, ring_s = 0.0;  // modal exposure of its strikes, falling by 60 dB a second since ring_s
  std::vector<double> quiet_s;            // per mode of the bank's levels: end of its audible ring
  std::vector<double> self;               // per coupled mode of the bank: sum of A_ii^2, bank::calc_self_coupling()
  std::vector<double> swing;              // per coupled mode: amplitude of q [m kg^1/2] by strikes, at swing_s
  double swing_s = 0.0;
  double coupling_ns = 0.0;      // of a sample
  double cascade_ns = 0.0;       // likewise; 0: no modes above the coupled ones
  std::vector<double> anchor_m;  // ways to the microphones by which kDoppler is judged
  synth::PerEffect<double> until_s{};
  synth::PerEffect<double> share{};  // the loudest call so far
  synth::PerEffect<SelectionReason> reason, call_reason;
  struct Lasting {
    std::uint64_t id = 0;
    double share = 0.0;  // of its damping, with all modes sounding
  };
  std::vector<Lasting> lasting;  // contacts that have not ended; those at rest have no further records
  struct Driving {
    std::uint64_t id = 0;
    double since_s = 0.0;  // end of its part of the ring
    double size = 0.0;
    events::LastingContact strongest;  // of the records since
    events::LastingContact last;       // valid until another record
  };
  std::vector<Driving> driving;         // contacts that slide or roll
  std::vector<events::Impulse> pulses;  // known parts of the last pulses that come in pieces
  std::vector<double> ring_m2_s2;       // per mode: mean square of q' [kg m^2 / s^2] by contacts, at ring_at_s
  double ring_at_s = 0.0;
  EffectSet now;
  bool decided = false;
  BodyPlan plan;

 private:
  void call_reflection(const Hearing& hearing, double time_s);
};

}  // namespace carillon::effects
