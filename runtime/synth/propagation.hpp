// The propagation of a body's sound: what it sends, and who hears it.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "runtime/events/events.hpp"
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
  std::optional<ListeningHead> head;  // for kHead; what does not go through it is heard as late
  int phase = 0;                      // of Directivity
};

/// The modes' sound with directivity: a delay line of its own for each ear, and for each mirrored one behind them. Invariant: the
/// centre of the multipoles is where body and attitude have it at each waypoint.
class DirectedSound {
 public:
  /// `ears`: with the mirrored ones. Throws InputError for a model without transfers. [main-thread]
  DirectedSound(const std::shared_ptr<const Model>& model, const std::vector<Vec3>& offsets_m, std::size_t straight,
                const PropagationOptions& options, EffectSet effects);

  /// The way of the body so far, turned like this at its end; then one waypoint at a time. [audio-thread]
  void begin(const Trajectory& body, double turned_s, const events::Quaternion& rotation) noexcept;
  void push(const events::BodyMotion& motion) noexcept;

  /// Brings the weights to the block of a sample. `track`: of the centre of mass. [audio-thread]
  void begin_block(std::int64_t sample, const Trajectory& track, const ListenerTracks& listener) noexcept;

  bool is_silent() const noexcept;
  void push_silence(std::int64_t samples) noexcept;
  /// What the weights hold of the samples that were rendered last, into the lines.
  void push_sound(std::size_t samples) noexcept;

  std::size_t get_ear_count() const noexcept { return receivers_.size(); }
  bool is_mirrored(std::size_t ear) const noexcept { return ear >= straight_; }
  Receiver& get_receiver(std::size_t ear) noexcept { return receivers_[ear]; }
  const Receiver& get_receiver(std::size_t ear) const noexcept { return receivers_[ear]; }
  Source make_source(std::size_t ear) const noexcept { return {.track = &centre_, .monopole = &lines_[ear], .dipole = {}}; }
  const DelayLine& get_line() const noexcept { return lines_.front(); }
  /// The microphone that ear stands for.
  std::size_t find_microphone(std::size_t ear) const noexcept { return ear % straight_; }
  /// The track to which its offset belongs.
  const Trajectory& find_track(const ListenerTracks& listener, std::size_t ear) const noexcept;

  std::unique_ptr<Directivity> weights;
  /// Without the samples of the lines.
  std::size_t calc_bytes() const noexcept;
  const std::vector<DelayLine>& get_lines() const noexcept { return lines_; }

 private:
  std::size_t straight_ = 0;  // ears that are not mirrored
  bool apart_ = false;        // an ear for each microphone
  double rate_hz_ = 0.0;
  Vec3 offset_m_{}, last_m_{};  // of the centre of the multipoles from that of mass: axes of the mesh, of the world at the last waypoint
  double last_s_ = 0.0;
  std::vector<Vec3> offsets_m_;  // of the ears from their tracks
  Attitude attitude_;
  Trajectory centre_;
  std::vector<DelayLine> lines_;
  std::vector<Receiver> receivers_;
};

/// Invariant: all its delay lines have the same samples. Without directivity modes send one sound all round, with it one to each
/// ear; acceleration noise sends its three dipoles in both cases. With ground reflection there is a mirrored ear for each. With a head
/// there is one ear, in its middle, and what arrives there goes through the head in the direction from which it comes.
struct Propagation {
  EffectSet effects;
  std::unique_ptr<DelayLine> monopole;               // with modes that send the same all round
  std::array<std::unique_ptr<DelayLine>, 3> dipole;  // with acceleration noise
  std::unique_ptr<DirectedSound> directed;           // with modes that do not
  std::vector<Receiver> ears;                        // one a microphone, or one for all without two ears
  std::vector<Receiver> mirrored;                    // with ground reflection as many, of monopole and dipole
  std::vector<HeadEars> head;                        // with a head: of what comes straight, and of what the ground reflects
  std::int64_t first = 0;                            // sample of the scene with which it began
  Source source;

  bool is_silent() const noexcept;
  /// Nothing is on its way to the ears, though a head may still sound.
  bool has_silent_lines() const noexcept;
  void push_silence(std::int64_t samples) noexcept;
  const DelayLine& get_line() const noexcept { return monopole ? *monopole : directed ? directed->get_line() : *dipole[0]; }
  /// The way of its longest sound at a sample [s]; 0 without travel time. [audio-thread]
  double calc_longest_s(const ListenerTracks& listener, std::int64_t sample) const noexcept;
  /// Of an ear, which stands for all microphones where the body is heard without two ears.
  const Trajectory& find_track(const ListenerTracks& listener, std::size_t ear, bool is_mirrored) const noexcept;
};

/// Whether a body of these effects is heard through a head.
bool has_head(EffectSet effects) noexcept;

/// How many ears a body of these effects has, with the mirrored ones; a head counts as one.
std::size_t count_ears(EffectSet effects, const PropagationOptions& options) noexcept;

/// Throws InputError for directivity of a model without transfers. [main-thread]
std::unique_ptr<Propagation> make_propagation(EffectSet effects, const PropagationOptions& options,
                                              const std::shared_ptr<const Model>& model);

}  // namespace carillon::synth
