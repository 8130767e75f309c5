// The inner loops of ears: one implementation for every instruction set, chosen when a filter is made.
#pragma once

namespace carillon::head {

inline constexpr int kChunk = 32;    // samples that a convolution makes at once
inline constexpr int kTapUnit = 16;  // taps come in multiples of this

/// One instruction set. Every sample is summed in the same order wherever it lies in a chunk, so that its bits do not depend on how the
/// calls divide the samples; they do depend on the instruction set. `x` points at the first sample of the chunk: taps - 1 samples before
/// it and kChunk from it on are read. [audio-thread]
struct Loops {
  /// out[n] = sum over k of h[k] x[n - k], for n below kChunk.
  void (*convolve)(const float* h, int taps, const float* x, float* out) noexcept;
  /// The same of two filters at once.
  void (*convolve_pair)(const float* h_a, const float* h_b, int taps, const float* x, float* out_a, float* out_b) noexcept;
  /// out[k] = weight[0] rows[0][k] + weight[1] rows[1][k] + weight[2] rows[2][k], for k below taps.
  void (*blend)(const float* const* rows, const float* weight, int taps, float* out) noexcept;
};

extern const Loops kPlainLoops;
#if defined(__x86_64__)
extern const Loops kAvx2Loops, kAvx512Loops;
#endif

/// The best one that this processor has. Any thread.
const Loops& get_loops() noexcept;

}  // namespace carillon::head
