// The sound of a recorded surface at any place.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "runtime/base/vector.hpp"
#include "runtime/recording/pole.hpp"
#include "runtime/recording/recording.hpp"

namespace carillon::recording {

/// Where it is heard. 0: from everywhere alike; 1: a figure of eight about the axis (a unit vector); between: (1 - q) + q cos.
struct Receiver {
  Vec3 place_m{};
  double directivity = 0.0;
  Vec3 axis{0.0, 1.0, 0.0};
};

/// Plays a recording once, from its beginning. What it keeps true: the pressure of any two receivers is that of the same surface; samples
/// come in order. Reads the file and takes memory while it plays: not for an audio thread.
class Player {
 public:
  /// The recording must outlive it. offset_m: added to all its places. receivers: how many.
  Player(const Recording& recording, std::size_t receivers, const Vec3& offset_m = {});

  /// Adds the next samples [Pa] at each receiver to out (receivers, count), while the receivers move to where they are now. Beyond the end
  /// of the recording what is still in the air arrives, then silence. Throws InputError when the file is cut off meanwhile.
  void play(std::span<const Receiver> receivers, std::size_t count, std::span<double> out);

  /// Samples that were played.
  std::uint64_t get_time() const { return time_; }

 private:
  static constexpr std::uint64_t kSegment = 16;  // samples over which distances are linear

  struct Spot {
    double delay, gain, turned;  // in samples; 1 / (4 pi r) times directivity; that times the cosine
  };

  void emit_segment(std::span<const Receiver> from, std::span<const Receiver> to);
  void find_places(std::uint64_t frame, std::vector<Vec3>& places_m);
  float get_acceleration(std::int64_t frame, std::size_t triangle);
  void look(const Receiver& receiver, std::size_t triangle, const std::vector<Vec3>& places_m, Spot& spot) const;

  const Recording* recording_;
  Vec3 offset_m_;
  std::vector<Pole> poles_;          // of bodies
  std::vector<double> state_;        // (T): P of E14
  std::vector<Vec3> places_m_[2];    // (V) at the ends of a segment
  std::vector<Vec3> keys_m_[4];      // (V) around the segment
  std::int64_t first_key_ = -100;    // of keys_m_
  std::vector<float> blocks_[3];     // (T, kBlockFrames): those around the frame
  std::int64_t first_block_ = -100;  // of blocks_
  std::vector<Receiver> last_;
  std::vector<std::vector<double>> arriving_;  // (receivers): from sample time_ on
  std::uint64_t time_ = 0, emitted_ = 0;
};

}  // namespace carillon::recording
