// Sound of a scene or simulation of any length, kept on disk.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "runtime/base/spool.hpp"

namespace carillon::sound {

/// Pressure [Pa], interleaved frames. Memory does not grow with the number of frames.
class SoundStore {
 public:
  SoundStore(int rate_hz, std::size_t channels, base::Spool spool = base::Spool())
      : rate_hz_(rate_hz), channels_(channels), samples_(std::move(spool)) {}

  int get_rate_hz() const { return rate_hz_; }
  std::size_t get_channels() const { return channels_; }
  std::uint64_t get_frames() const { return samples_.size() / channels_; }

  /// Appends whole frames. Throws SystemError for a disk error.
  void append(std::span<const float> frames) { samples_.append(frames); }
  /// Reads whole frames from `first` on; they must exist.
  void read(std::uint64_t first, std::span<float> frames) const { samples_.read(first * channels_, frames); }

  /// All frames in order, in pieces: work(first frame, samples of whole frames).
  template <class Work>
  void for_each_piece(Work&& work) const {
    std::vector<float> piece(kPiece * channels_);
    for (std::uint64_t first = 0; first < get_frames(); first += kPiece) {
      const std::size_t count = std::min<std::uint64_t>(kPiece, get_frames() - first);
      const std::span<float> frames = std::span(piece).first(count * channels_);
      read(first, frames);
      work(first, std::span<const float>(frames));
    }
  }

 private:
  static constexpr std::size_t kPiece = 4096;  // frames
  int rate_hz_ = 0;
  std::size_t channels_ = 0;
  base::Records<float> samples_;
};

}  // namespace carillon::sound
