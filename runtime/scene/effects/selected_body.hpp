// One body of an EffectSelector: the calls for its effects, and its sound.
#pragma once

#include <cstdint>
#include <vector>

#include "runtime/scene/effects/effect_selector.hpp"
#include "runtime/scene/effects/hearing.hpp"

namespace carillon::effects {

/// Invariant: `reason` of an effect belongs to its loudest call.
struct SelectedBody {
  /// Throws InputError if arrays of the bank disagree.
  SelectedBody(const BodyFacts& of, const BankLevels& levels, Hearing& hearing);

  /// Excludes an effect.
  void refuse(Effect effect, const SelectionReason& reason);
  /// Calls for an effect with this share of the sound; it counts if the share exceeds `limit`, by default audible_share.
  void call(Effect effect, double share, const SelectionReason& reason) { call(effect, share, reason, audible_share); }
  void call(Effect effect, double share, const SelectionReason& reason, double limit);
  /// Calls for directivity. `spread_db`: standard deviation of the level over directions.
  void call_directivity(double spread_db);
  /// Calls for effects of propagation at a time.
  void call_propagation(Hearing& hearing, double time_s);
  /// Extends the audible ring of each mode; `levels`: of the modes at `time_s`, relative to the inaudible level. Returns the time when the
  /// last mode becomes inaudible; kNever if all are inaudible.
  double ring_out(double time_s, const std::vector<double>& levels);

  const BodyFacts* facts;
  const BankLevels* bank;
  EffectSet possible, called;
  Vec3 position_m{};
  double audible_share = kAudibleShare;
  double nearest_m = 0.0;                 // shortest distance to a microphone so far
  double sounds_until_s = kNever;         // at the body
  double mean_hz = 0.0;                   // of its audible sound
  double ring_pa2_s = 0.0, ring_s = 0.0;  // modal exposure of its strikes, falling by 60 dB a second since ring_s
  std::vector<double> quiet_s;            // per mode of the bank's levels: end of its audible ring
  std::vector<double> self;               // per coupled mode of the bank: sum of A_ii^2, bank::calc_self_coupling()
  std::vector<double> swing;              // per coupled mode: amplitude of q [m kg^1/2] by strikes, at swing_s
  double swing_s = 0.0;
  bool has_cascade = false;          // modes above the coupled ones, a mass and a thickness
  std::vector<double> anchor_m;      // distances to the microphones at the last Doppler call, or while silent
  synth::PerEffect<double> share{};  // of the loudest call so far
  synth::PerEffect<SelectionReason> reason;
  struct Lasting {
    std::uint64_t id = 0;
    double share = 0.0;  // of its damping, if all modes sound
  };
  std::vector<Lasting> lasting;  // open contacts; those at rest have no further records
  struct Driving {
    std::uint64_t id = 0;
    double since_s = 0.0;  // start of the part that ring_m2_s2 does not include
    double size = 0.0;
    events::LastingContact strongest;  // of the records since
    events::LastingContact last;       // valid until another record
  };
  std::vector<Driving> driving;         // contacts that slide or roll
  std::vector<events::Impulse> pulses;  // known parts of the last pulses that come in pieces
  std::vector<double> ring_m2_s2;       // per mode: mean square of q' [kg m^2 / s^2] by contacts, at ring_at_s
  double ring_at_s = 0.0;

 private:
  void call_reflection(const Hearing& hearing, double time_s);
};

}  // namespace carillon::effects
