// Propagation of a body's sound: delay lines and receivers.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "runtime/events/events.hpp"
#include "runtime/synth/ambisonics.hpp"
#include "runtime/synth/delay_line.hpp"
#include "runtime/synth/directivity.hpp"
#include "runtime/synth/effects.hpp"
#include "runtime/synth/floor.hpp"
#include "runtime/synth/head_ears.hpp"
#include "runtime/synth/listener.hpp"
#include "runtime/synth/model.hpp"
#include "runtime/synth/receiver.hpp"
#include "runtime/synth/trajectory.hpp"

namespace carillon::synth {

struct PropagationOptions {
  double rate_hz = 0.0;
  std::vector<Vec3> microphones_m;  // from the listener
  double longest_m = 0.0;
  int max_waypoints = 0;
  std::optional<Floor> floor;         // for kGroundReflection
  std::optional<ListeningHead> head;  // for kHead; sound without it is delayed as much
  int phase = 0;                      // of Directivity
};

/// Modal sound with directivity: weights and a receiver for each ear, the mirrored ears last. Invariant: at each waypoint the centre of the
/// multipoles follows from the position and attitude of the body.
class DirectedSound {
 public:
  /// For a body of these effects. Throws InputError for a model without transfers. [main-thread]
  DirectedSound(EffectSet effects, const PropagationOptions& options, const std::shared_ptr<const Model>& model);

  /// begin(): trajectory of the body so far and its last attitude; push(): one waypoint. [audio-thread]
  void begin(const Trajectory& body, double turned_s, const events::Quaternion& rotation) noexcept;
  void push(const events::BodyMotion& motion) noexcept;

  /// Updates the weights to the block of a sample. `track`: of the centre of mass. [audio-thread]
  void begin_block(std::int64_t sample, const Trajectory& track, const ListenerTracks& listener) noexcept;

  std::size_t get_ear_count() const noexcept { return receivers_.size(); }
  bool is_mirrored(std::size_t ear) const noexcept { return ear >= straight_; }
  Receiver& get_receiver(std::size_t ear) noexcept { return receivers_[ear]; }
  const Trajectory& get_centre() const noexcept { return centre_; }
  std::size_t find_microphone(std::size_t ear) const noexcept { return ear % straight_; }
  /// Track to which the ear's offset belongs.
  const Trajectory& find_track(const ListenerTracks& listener, std::size_t ear) const noexcept;

  std::unique_ptr<Directivity> weights;

 private:
  std::size_t straight_ = 0;  // ears that are not mirrored
  bool apart_ = false;        // one ear per microphone
  double rate_hz_ = 0.0;
  Vec3 offset_m_{}, last_m_{};  // centre of the multipoles from the centre of mass: in mesh axes, in world axes at the last waypoint
  double last_s_ = 0.0;
  std::vector<Vec3> offsets_m_;  // of the ears from their tracks
  Attitude attitude_;
  Trajectory centre_;
  std::vector<Receiver> receivers_;
};

/// Invariant: all delay lines hold the same samples. Without directivity the modes have one delay line, with it one per ear; acceleration
/// noise has its three dipoles in both cases. Ground reflection adds a mirrored ear for each ear. A head has one ear in its middle, whose
/// sound is filtered, or encoded for Ambisonics, by the direction of arrival.
struct Propagation {
  EffectSet effects;
  std::unique_ptr<DelayLine> monopole;               // modes without directivity
  std::array<std::unique_ptr<DelayLine>, 3> dipole;  // acceleration noise
  std::unique_ptr<DirectedSound> directed;           // modes with directivity
  std::vector<DelayLine> directed_lines;             // one per ear of `directed`
  std::vector<Receiver> ears;                        // one per microphone, or one for all without two ears
  std::vector<Receiver> mirrored;                    // ground reflection of monopole and dipole: one per ear
  std::vector<HeadEars> head;                        // of the straight sound, and of the reflected one
  std::vector<AmbisonicEncoder> ambisonics;          // in place of `head`
  Source source;

  /// False also while a head still sounds.
  bool is_silent() const noexcept;
  void push_silence(std::int64_t samples) noexcept;
  /// Track to which an ear's offset belongs.
  const Trajectory& find_track(const ListenerTracks& listener, std::size_t ear, bool is_mirrored) const noexcept;
  /// Source of an ear of a directed sound that uses directed_lines.
  Source make_source(const DirectedSound& of, std::size_t ear) const noexcept {
    return {.track = &of.get_centre(), .monopole = &directed_lines[ear], .dipole = {}};
  }
};

/// True for a body heard through a head.
bool has_head(EffectSet effects) noexcept;

/// Throws InputError for directivity of a model without transfers. [main-thread]
std::unique_ptr<Propagation> make_propagation(EffectSet effects, const PropagationOptions& options,
                                              const std::shared_ptr<const Model>& model);

}  // namespace carillon::synth
