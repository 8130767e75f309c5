// The sound of a recorded surface at any place.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "runtime/base/vector.hpp"
#include "runtime/acoustics/recording/pole.hpp"
#include "runtime/acoustics/recording/recording.hpp"

namespace carillon::recording {

/// Where it is heard. 0: from everywhere alike; 1: a figure of eight about the axis (a unit vector); between: (1 - q) + q cos.
struct Microphone {
  Vec3 place_m{};
  double directivity = 0.0;
  Vec3 axis{0.0, 1.0, 0.0};
};

/// A receiver at one time, and how it moves: slower than sound.
struct MovingMicrophone {
  Microphone receiver;
  Vec3 velocity_m_s{};
};
/// Where a receiver is, seconds after the recording began; continuous in time.
using Way = std::function<MovingMicrophone(std::size_t receiver, double time_s)>;

/// Plays a recording once, from its beginning. Invariant: the pressure of any two receivers is that of the same surface; samples
/// come in order; the pressure at a receiver that moves is that at one at rest where it is at that time. Reads the file and takes memory
/// while it plays: not for an audio thread. Costs some 45 ns for each triangle and sample of the recording, and 65 ns for each receiver.
class Player {
 public:
  /// The recording must outlive it. receivers: how many.
  Player(const RecordedSurface& recording, std::size_t receivers);

  /// Adds the next samples [Pa] at each receiver to out (receivers, count), at the rate of the recording. Beyond the end of the recording
  /// what is still in the air arrives, then silence. `way` is asked for times up to the arrival of what leaves now. Throws InputError when
  /// the file is cut off meanwhile.
  void play(const Way& way, std::size_t count, std::span<double> out);
  /// The same for receivers that stay where they are.
  void play(std::span<const Microphone> receivers, std::size_t count, std::span<double> out);

  /// Nothing will arrive any more.
  bool is_over() const;

  /// Samples that were played.
  std::uint64_t get_time() const { return time_; }

 private:
  static constexpr std::uint64_t kSegment = 16;  // samples over which distances are linear

  struct Spot {
    double delay, gain, turned;  // in samples; 1 / (4 pi r) times directivity; that times the cosine
  };
  /// A receiver when the sound of the middle of the surface arrives, which left `delay_s` before.
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
  std::vector<float> blocks_[3];               // (T, kBlockFrames): those around the frame
  std::int64_t first_block_ = -100;            // of blocks_
  std::vector<Ear> ears_[2];                   // (receivers) at the ends of a segment
  std::vector<std::vector<double>> arriving_;  // (receivers): from sample time_ on
  std::uint64_t time_ = 0, emitted_ = 0;
};

}  // namespace carillon::recording
