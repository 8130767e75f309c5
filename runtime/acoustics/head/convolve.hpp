// Inner loops of head filters, selected by instruction set at run time.
#pragma once

#include "runtime/base/instructions.hpp"

namespace carillon::head {

inline constexpr int kChunk = 32;    // samples per convolution
inline constexpr int kTapUnit = 16;  // numbers of taps are multiples of this

/// Loops of one instruction set. Sums have the same order at every position in a chunk, so bits do not depend on the block sizes; they do
/// depend on the instruction set. `x`: first sample of the chunk; reads taps - 1 samples before it and kChunk from it on. [audio-thread]
struct Loops {
  /// out[n] = sum over k of h[k] x[n - k], for n below kChunk.
  void (*convolve)(const float* h, int taps, const float* x, float* out) noexcept;
  /// Two filters at once.
  void (*convolve_pair)(const float* h_a, const float* h_b, int taps, const float* x, float* out_a, float* out_b) noexcept;
  /// out[k] = weight[0] rows[0][k] + weight[1] rows[1][k] + weight[2] rows[2][k], for k below taps.
  void (*blend)(const float* const* rows, const float* weight, int taps, float* out) noexcept;
};

/// Loops of the best supported instruction set up to `best`. Any thread.
const Loops& get_loops(base::Instructions best = base::Instructions::kBest) noexcept;

}  // namespace carillon::head
