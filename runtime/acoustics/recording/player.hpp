// Sound of a recorded surface at any place.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "runtime/acoustics/recording/pole.hpp"
#include "runtime/acoustics/recording/recording.hpp"
#include "runtime/base/vector.hpp"

namespace carillon::recording {

/// Receiver. Directivity q: 0 omnidirectional, 1 figure of eight about the axis (unit vector), in general (1 - q) + q cos.
struct Microphone {
  Vec3 place_m{};
  double directivity = 0.0;
  Vec3 axis{0.0, 1.0, 0.0};
};

/// Receiver at one time with its velocity, below the speed of sound.
struct MovingMicrophone {
  Microphone receiver;
  Vec3 velocity_m_s{};
};
/// Receiver at a time since the start of the recording; continuous in time.
using Way = std::function<MovingMicrophone(std::size_t receiver, double time_s)>;

/// Plays a recording once, from its beginning. Invariant: all receivers hear the same surface; samples are in order; the pressure at a
/// moving receiver is that at a resting one at its current place. Reads the file and allocates while playing: not for an audio thread.
/// Cost: about 45 ns per triangle and sample, and 65 ns per receiver in addition.
class Player {
 public:
  /// The recording must outlive the player.
  Player(const RecordedSurface& recording, std::size_t receivers);

  /// Adds the next samples [Pa] at each receiver to out (receivers, count), at the rate of the recording. After the end of the recording
  /// the sound still in the air arrives, then silence. `way` is called for times up to the arrival of the sound emitted now. Throws
  /// InputError if the file is truncated meanwhile.
  void play(const Way& way, std::size_t count, std::span<double> out);
  /// Resting receivers.
  void play(std::span<const Microphone> receivers, std::size_t count, std::span<double> out);

  /// All sound has arrived.
  bool is_over() const;

  /// Number of played samples.
  std::uint64_t get_time() const { return time_; }

 private:
  static constexpr std::uint64_t kSegment = 16;  // samples over which distances are linear

  struct Spot {
    double delay, gain, turned;  // in samples; 1 / (4 pi r) times directivity; that times the cosine
  };
  /// Receiver at the arrival of the sound of the centre of the surface, emitted `delay_s` earlier.
  struct Ear {
    MovingMicrophone at;
    bool moves = false;
    double delay_s = 0.0;
  };

  void emit_segment(const Way& way);
  void find_ears(const Way& way, double time_s, const std::vector<Vec3>& places_m, std::vector<Ear>& ears) const;
  void find_places(std::uint64_t frame, std::vector<Vec3>& places_m);
  float get_acceleration(std::int64_t frame, std::size_t triangle);
  void look(const Ear& ear, std::size_t triangle, const std::vector<Vec3>& places_m, Spot& spot) const;
  void release();

  const RecordedSurface* recording_;
  std::vector<Pole> poles_;                    // of bodies
  std::vector<double> state_;                  // (T): P of E14
  std::vector<Vec3> places_m_[2];              // (V) at the ends of a segment
  std::vector<Vec3> keys_m_[4];                // (V) around the segment
  std::int64_t first_key_ = -100;              // of keys_m_
  std::vector<float> blocks_[3];               // blocks around the frame
  std::int64_t first_block_ = -100;            // of blocks_
  std::vector<Ear> ears_[2];                   // (receivers) at the ends of a segment
  std::vector<std::vector<double>> arriving_;  // (receivers): from sample time_ on
  std::uint64_t time_ = 0, emitted_ = 0;
};

}  // namespace carillon::recording
