// Method:     an ear reads a delay_line through a windowed sinc between two rows of a table. Where its phase stays, samples are in the
//             lanes and a sub-block is one convolution; where it moves, taps are in the lanes and the sources of one place, which all are
//             read with the same taps, are summed before.
// Source:     docs/equations.md.
//
// Included by kernels.cpp after kernels_body.inl.

void convolve(const float* taps, const float* samples, float* out) noexcept {
  constexpr int kParts = kSubBlock / F::kWidth;
  constexpr int kHeld = kParts < 4 ? kParts : 4, kSets = 8 / kHeld;
  for (int part = 0; part < kParts; part += kHeld) {
    const float* from = samples + part * F::kWidth;
    F sum[kSets][kHeld];
#pragma GCC unroll 8
    for (int set = 0; set < kSets; ++set) {
      const F tap = F::all(taps[set]);
#pragma GCC unroll 8
      for (int v = 0; v < kHeld; ++v) sum[set][v] = tap * F::load(from + set + v * F::kWidth);
    }
    for (int t = kSets; t < kTaps; t += kSets) {
#pragma GCC unroll 8
      for (int set = 0; set < kSets; ++set) {
        const F tap = F::all(taps[t + set]);
#pragma GCC unroll 8
        for (int v = 0; v < kHeld; ++v) sum[set][v] = fma(tap, F::load(from + t + set + v * F::kWidth), sum[set][v]);
      }
    }
#pragma GCC unroll 8
    for (int v = 0; v < kHeld; ++v) {
#pragma GCC unroll 8
      for (int set = 1; set < kSets; ++set) sum[0][v] = sum[0][v] + sum[set][v];
      sum[0][v].store(out + (part + v) * F::kWidth);
    }
  }
}

void read(const Reading* readings, int count, float* out) noexcept {
  constexpr int kParts = kTaps / F::kWidth;
  for (int i = 0; i < count; ++i) {
    const Reading& reading = readings[i];
    const F mix = F::all(reading.mix);
    const auto get_tap = [&](int at) HWY_ATTR {
      const F tap = F::load(reading.taps + at);
      return fma(mix, F::load(reading.taps + kTaps + at) - tap, tap);
    };
    // Sources more or less that are silent do not change a bit.
    F sum[2] = {F::zero(), F::zero()};
    if (reading.sources == 1 && reading.weight[0] == 1.0F) {
#pragma GCC unroll 8
      for (int v = 0; v < kParts; ++v) sum[v % 2] = fma(get_tap(v * F::kWidth), F::load(reading.source[0] + v * F::kWidth), sum[v % 2]);
    } else {
#pragma GCC unroll 8
      for (int v = 0; v < kParts; ++v) {
        F heard = F::zero();
        for (int k = 0; k < reading.sources; ++k) {
          heard = fma(F::all(reading.weight[k]), F::load(reading.source[k] + v * F::kWidth), heard);
        }
        sum[v % 2] = fma(get_tap(v * F::kWidth), heard, sum[v % 2]);
      }
    }
    out[i] = (sum[0] + sum[1]).sum();
  }
}
