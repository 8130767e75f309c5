// Method:     a block of kPeriod samples of a driven bank. Every decaying exponential of a block is a sum of kReach (or two or three times as
//             many) neighbouring exponentials of a grid of kGridPoints frequencies, so modes meet their common input and output on that
//             grid: what the block leaves in a mode is a short sum over the spectrum of the input, and what all modes sound like in the
//             next block is one inverse transform of the sum of what each adds to the grid. Both transforms are products with small
//             matrices: with p = 16 a + b and t = 16 u + r, e^{2 pi i p t / 256} = e^{2 pi i a r / 16} e^{2 pi i b r / 256}
//             e^{2 pi i b u / 16}, the last index of the result in the lanes, the middle sum cut by a butterfly of radix 4.
// Source:     docs/decisions/driven-bank.md.
// Deviations: none.
//
// Included by kernels_*.cpp as kernels_body.inl is, with one type more: H, of kReach or fewer lanes of float. kRowSets, kTapSets: independent
// sums that hide the latency of the multiply-adds. The functions stay apart: all in one, g++ 12 makes them slower by an eighth.

constexpr int kLaneVectors = 16 / F::kWidth;
constexpr int kRowVectors = 2 * kReach / F::kWidth;

/// Makes the compiler load what two multiply-adds share once: it would rather load it in each of them.
inline F hold(F x) noexcept {
#if defined(__x86_64__)
  if constexpr (F::kWidth > 4) __asm__("" : "+v"(x.v));
#endif
  return x;
}

/// Sixteen complex numbers in lanes.
struct Line {
  F re[kLaneVectors], im[kLaneVectors];
};

/// sum over r < 16 of e^{2 pi i a r / 16} of twiddled lines, prepared: part[a % 4][r], r < 4, are what is left to be summed.
inline void fold(const GridTransform& transform, const Line* line, Line (*part)[4]) noexcept {
  for (int r = 0; r < 4; ++r) {
#pragma GCC unroll 16
    for (int v = 0; v < kLaneVectors; ++v) {
      F re[4], im[4];
#pragma GCC unroll 4
      for (int q = 0; q < 4; ++q) {
        const Line& from = line[r + 4 * q];
        const F c = F::load(transform.twiddle_re[r + 4 * q] + v * F::kWidth), s = F::load(transform.twiddle_im[r + 4 * q] + v * F::kWidth);
        re[q] = less(from.re[v] * c, from.im[v], s);
        im[q] = fma(from.re[v], s, from.im[v] * c);
      }
      const F even_re = re[0] + re[2], even_im = im[0] + im[2], odd_re = re[0] - re[2], odd_im = im[0] - im[2];
      const F other_re = re[1] + re[3], other_im = im[1] + im[3], cross_re = re[1] - re[3], cross_im = im[1] - im[3];
      part[0][r].re[v] = even_re + other_re;
      part[0][r].im[v] = even_im + other_im;
      part[1][r].re[v] = odd_re - cross_im;
      part[1][r].im[v] = odd_im + cross_re;
      part[2][r].re[v] = even_re - other_re;
      part[2][r].im[v] = even_im - other_im;
      part[3][r].re[v] = odd_re + cross_im;
      part[3][r].im[v] = odd_im - cross_re;
    }
  }
}

/// spectrum[kGridMargin + p] = sum of window[t] input[kPeriod - 1 - t] e^{2 pi i p t / kGridPoints}.
[[gnu::noinline]] void analyse(const GridTransform& transform, const float* input, float* spectrum_re, float* spectrum_im) noexcept {
  alignas(64) float x[kPeriod];
  for (int t = 0; t < kPeriod; ++t) x[t] = transform.window[t] * input[kPeriod - 1 - t];
  Line line[16], part[4][4];
  for (int r = 0; r < 16; ++r) {
    Line sum;
#pragma GCC unroll 16
    for (int v = 0; v < kLaneVectors; ++v) sum.re[v] = F::all(x[r]), sum.im[v] = F::zero();
#pragma GCC unroll 8
    for (int u = 1; u < 8; ++u) {
      const F value = F::all(x[16 * u + r]);
#pragma GCC unroll 16
      for (int v = 0; v < kLaneVectors; ++v) {
        sum.re[v] = fma(F::load(transform.turn_re[u] + v * F::kWidth), value, sum.re[v]);
        sum.im[v] = fma(F::load(transform.turn_im[u] + v * F::kWidth), value, sum.im[v]);
      }
    }
    line[r] = sum;
  }
  fold(transform, line, part);
  float* out_re = spectrum_re + kGridMargin;
  float* out_im = spectrum_im + kGridMargin;
  for (int a = 0; a < 8; ++a) {
    const Line* from = part[a % 4];
#pragma GCC unroll 16
    for (int v = 0; v < kLaneVectors; ++v) {
      F re = from[0].re[v], im = from[0].im[v];
#pragma GCC unroll 4
      for (int r = 1; r < 4; ++r) {
        const F c = F::all(transform.turn_re[a][r]), s = F::all(transform.turn_im[a][r]);
        re = less(fma(from[r].re[v], c, re), from[r].im[v], s);
        im = fma(from[r].re[v], s, fma(from[r].im[v], c, im));
      }
      re.store(out_re + 16 * a + v * F::kWidth);
      im.store(out_im + 16 * a + v * F::kWidth);
    }
  }
  // p = 128 is (-1)^t; beyond both ends the spectrum of real numbers is its own mirror image.
  float last = 0.0F;
  for (int t = 0; t < kPeriod; t += 2) last += x[t] - x[t + 1];
  constexpr int kHalf = kGridPoints / 2;
  out_re[kHalf] = last;
  out_im[kHalf] = 0.0F;
  for (int p = 1; p <= kGridMargin; ++p) {
    out_re[-p] = out_re[p];
    out_im[-p] = -out_im[p];
  }
  for (int p = 1; p < kGridMargin; ++p) {
    out_re[kHalf + p] = out_re[kHalf - p];
    out_im[kHalf + p] = -out_im[kHalf - p];
  }
}

/// out[t] = window[t] Re sum over p of grid[kGridMargin + p] e^{2 pi i p t / kGridPoints}. Changes the grid.
[[gnu::noinline]] void synthesise(const GridTransform& transform, float* grid_re, float* grid_im, float* out) noexcept {
  constexpr int kHalf = kGridPoints / 2;
  float* re = grid_re + kGridMargin;
  float* im = grid_im + kGridMargin;
  // The real part does not feel it when a number and its frequency are both conjugated.
  for (int p = 1; p <= kGridMargin; ++p) {
    re[p] += re[-p];
    im[p] -= im[-p];
  }
  for (int p = 1; p < kGridMargin; ++p) {
    re[kHalf - p] += re[kHalf + p];
    im[kHalf - p] -= im[kHalf + p];
  }
  Line line[16], part[4][4];
  constexpr int kTogether = F::kWidth == 16 ? 4 : F::kWidth == 8 ? 2 : 1;
  for (int b = 0; b < 16; b += kTogether) {
    Line sum[kTogether];
#pragma GCC unroll 4
    for (int c = 0; c < kTogether; ++c) {
#pragma GCC unroll 16
      for (int v = 0; v < kLaneVectors; ++v) sum[c].re[v] = F::all(re[b + c]), sum[c].im[v] = F::all(im[b + c]);
    }
#pragma GCC unroll 8
    for (int a = 1; a < 8; ++a) {
#pragma GCC unroll 4
      for (int c = 0; c < kTogether; ++c) {
        const F x = F::all(re[16 * a + b + c]), y = F::all(im[16 * a + b + c]);
#pragma GCC unroll 16
        for (int v = 0; v < kLaneVectors; ++v) {
          const F cosine = F::load(transform.turn_re[a] + v * F::kWidth), sine = F::load(transform.turn_im[a] + v * F::kWidth);
          sum[c].re[v] = less(fma(cosine, x, sum[c].re[v]), sine, y);
          sum[c].im[v] = fma(sine, x, fma(cosine, y, sum[c].im[v]));
        }
      }
    }
#pragma GCC unroll 4
    for (int c = 0; c < kTogether; ++c) line[b + c] = sum[c];
  }
  const F last = F::all(re[kHalf]);
#pragma GCC unroll 16
  for (int v = 0; v < kLaneVectors; ++v) line[0].re[v] = fma(F::load(transform.alternate + v * F::kWidth), last, line[0].re[v]);
  fold(transform, line, part);
  for (int u = 0; u < 8; ++u) {
    const Line* from = part[u % 4];
#pragma GCC unroll 16
    for (int v = 0; v < kLaneVectors; ++v) {
      F sum = from[0].re[v];
#pragma GCC unroll 4
      for (int b = 1; b < 4; ++b) {
        sum = less(fma(from[b].re[v], F::all(transform.turn_re[u][b]), sum), from[b].im[v], F::all(transform.turn_im[u][b]));
      }
      const int t = 16 * u + v * F::kWidth;
      (sum * F::load(transform.window + t)).store(out + t);
    }
  }
}

/// Turns a group over a period, adds what the input left in it and a step of force, and keeps the new state in single precision for what follows.
inline void turn_group(const FilterBank& bank, int group, D step, const F* left_re, const F* left_im) noexcept {
  const FilterTurn& turn = bank.turns[group];
  ModeState& state = bank.states[group];
#pragma GCC unroll 16
  for (int v = 0; v < kGroup / F::kWidth; ++v) {
    const int lane = v * F::kWidth;
    const D c = D::load(turn.re + lane), s = D::load(turn.im + lane), x = D::load(state.re + lane), y = D::load(state.im + lane);
    const D re = more(less(more(D::widen(left_re[v]), c, x), s, y), D::widen(F::load(turn.step_re + lane)), step);
    const D im = more(more(more(D::widen(left_im[v]), s, x), c, y), D::widen(F::load(turn.step_im + lane)), step);
    re.store(state.re + lane);
    im.store(state.im + lane);
    re.narrow().store(bank.start_re + group * kGroup + lane);
    im.narrow().store(bank.start_im + group * kGroup + lane);
  }
}

/// What a block of input leaves in the modes of the grid.
[[gnu::noinline]] void gather(const FilterBank& bank, D step, const float* spectrum_re, const float* spectrum_im) noexcept {
  constexpr int kParts = kGroup / F::kWidth;
  const float* weight = bank.weights;
  for (int g = 0; g < bank.groups; ++g) {
    const GridWindow window = bank.windows[g];
    const float* from_re = spectrum_re + window.first;
    const float* from_im = spectrum_im + window.first;
    F re[kParts], im[kParts], cross_re[kParts], cross_im[kParts];
#pragma GCC unroll 16
    for (int v = 0; v < kParts; ++v) re[v] = im[v] = cross_re[v] = cross_im[v] = F::zero();
    for (int p = 0; p < window.points; p += kPointStep, weight += kPointStep * 2 * kGroup) {
#pragma GCC unroll 4
      for (int q = 0; q < kPointStep; ++q) {
        const F x = F::all(from_re[p + q]), y = F::all(from_im[p + q]);
#pragma GCC unroll 16
        for (int v = 0; v < kParts; ++v) {
          const F a = hold(F::load(weight + q * 2 * kGroup + v * F::kWidth)), b = hold(F::load(weight + (2 * q + 1) * kGroup + v * F::kWidth));
          re[v] = fma(a, x, re[v]);
          im[v] = fma(b, x, im[v]);
          cross_re[v] = fma(b, y, cross_re[v]);
          cross_im[v] = fma(a, y, cross_im[v]);
        }
      }
    }
#pragma GCC unroll 16
    for (int v = 0; v < kParts; ++v) {
      re[v] = re[v] - cross_re[v];
      im[v] = im[v] + cross_im[v];
    }
    turn_group(bank, g, step, re, im);
  }
}

/// What the modes add to the grid; then the grid, summed.
[[gnu::noinline]] void scatter(const FilterBank& bank, float* grid_re, float* grid_im) noexcept {
  const float* row = bank.rows;
  const float* const start_re = bank.start_re;
  const float* const start_im = bank.start_im;
  float* const copies = bank.copies;
  const GridRun* const end = bank.runs + bank.run_count;
  for (const GridRun* run = bank.runs; run < end; ++run) {
    const float* re = start_re + run->first_mode;
    const float* im = start_im + run->first_mode;
    F sum[kRowSets][2][kRowVectors];
    const auto add = [&](int m, bool first) {
#pragma GCC unroll 4
      for (int set = 0; set < kRowSets; ++set) {
        const F x = F::all(re[m + set]), y = F::all(im[m + set]);
#pragma GCC unroll 16
        for (int v = 0; v < kRowVectors; ++v) {
          const F weight = hold(F::load(row + set * 2 * kReach + v * F::kWidth));
          sum[set][0][v] = first ? weight * x : fma(weight, x, sum[set][0][v]);
          sum[set][1][v] = first ? weight * y : fma(weight, y, sum[set][1][v]);
        }
      }
      row += 2 * kReach * kRowSets;
    };
    add(0, true);
#pragma GCC unroll 4
    for (int m = kRowSets; m < kRunStep; m += kRowSets) add(m, false);
    for (int m = kRunStep; m < run->modes; m += kRunStep) {
#pragma GCC unroll 4
      for (int n = 0; n < kRunStep; n += kRowSets) add(m + n, false);
    }
    alignas(64) float by_re[2 * kReach], by_im[2 * kReach];
#pragma GCC unroll 16
    for (int v = 0; v < kRowVectors; ++v) {
#pragma GCC unroll 4
      for (int set = 1; set < kRowSets; ++set) {
        sum[0][0][v] = sum[0][0][v] + sum[set][0][v];
        sum[0][1][v] = sum[0][1][v] + sum[set][1][v];
      }
      sum[0][0][v].store(by_re + v * F::kWidth);
      sum[0][1][v].store(by_im + v * F::kWidth);
    }
    float* copy_re = copies + run->place;
    float* copy_im = copy_re + kGridSize;
#pragma GCC unroll 8
    for (int j = 0; j < kReach; j += H::kWidth) {
      (H::load(copy_re + j) + (H::load(by_re + j) - H::load(by_im + kReach + j))).store(copy_re + j);
      (H::load(copy_im + j) + (H::load(by_re + kReach + j) + H::load(by_im + j))).store(copy_im + j);
    }
  }
  for (int part = 0; part < 2; ++part) {
    float* grid = part == 0 ? grid_re : grid_im;
    for (int at = 0; at < kGridSize; at += F::kWidth) {
      F sum = F::zero();
#pragma GCC unroll 8
      for (int copy = 0; copy < kReach; ++copy) {
        float* from = copies + (2 * copy + part) * kGridSize + at;
        sum = sum + F::load(from);
        F::zero().store(from);
      }
      sum.store(grid + at);
    }
  }
}

/// The modes that are in no grid: products with all samples of their exponential.
[[gnu::noinline]] void filter_directly(const FilterBank& bank, D step, const float* input, float* out) noexcept {
  constexpr int kParts = kGroup / F::kWidth;
  alignas(64) float x[kPeriod];
  for (int t = 0; t < kPeriod; ++t) x[t] = input[kPeriod - 1 - t];
  for (int g = 0; g < bank.direct_groups; ++g) {
    const DirectTable& table = bank.direct[g];
    alignas(64) float sum_re[kGroup], sum_im[kGroup];
    for (int lane = 0; lane < kGroup; ++lane) {
      F re[2] = {F::zero(), F::zero()}, im[2] = {F::zero(), F::zero()};
      for (int t = 0; t < kPeriod; t += 2 * F::kWidth) {
#pragma GCC unroll 2
        for (int odd = 0; odd < 2; ++odd) {
          const int at = t + odd * F::kWidth;
          const F value = F::load(x + at);
          re[odd] = fma(F::load(table.re[lane] + at), value, re[odd]);
          im[odd] = fma(F::load(table.im[lane] + at), value, im[odd]);
        }
      }
      alignas(64) float lanes_re[F::kWidth], lanes_im[F::kWidth];
      (re[0] + re[1]).store(lanes_re);
      (im[0] + im[1]).store(lanes_im);
      sum_re[lane] = add_lanes<F::kWidth>(lanes_re);
      sum_im[lane] = add_lanes<F::kWidth>(lanes_im);
    }
    F left_re[kParts], left_im[kParts];
#pragma GCC unroll 16
    for (int v = 0; v < kParts; ++v) {
      const int lane = v * F::kWidth;
      const F re = F::load(sum_re + lane), im = F::load(sum_im + lane), c = F::load(table.scale_re + lane), s = F::load(table.scale_im + lane);
      left_re[v] = less(re * c, im, s);
      left_im[v] = fma(re, s, im * c);
    }
    const int group = bank.groups + g;
    turn_group(bank, group, step, left_re, left_im);
    const float* re = bank.start_re + group * kGroup;
    const float* im = bank.start_im + group * kGroup;
    constexpr int kHeld = 8;
    for (int t = 0; t < kPeriod; t += kHeld * F::kWidth) {
      F sum[kHeld];
#pragma GCC unroll 8
      for (int v = 0; v < kHeld; ++v) sum[v] = F::load(out + t + v * F::kWidth);
      for (int lane = 0; lane < kGroup; ++lane) {
        const F a = F::all(re[lane]), b = F::all(im[lane]);
#pragma GCC unroll 8
        for (int v = 0; v < kHeld; ++v) {
          sum[v] = less(fma(F::load(table.re[lane] + t + v * F::kWidth), a, sum[v]), F::load(table.im[lane] + t + v * F::kWidth), b);
        }
      }
#pragma GCC unroll 8
      for (int v = 0; v < kHeld; ++v) sum[v].store(out + t + v * F::kWidth);
    }
  }
}

void filter(const FilterBank& bank, const float* input, double step, float* ringing) noexcept {
  const D wide_step = D::all(step);
  if (bank.groups > 0) {
    alignas(64) float re[kGridSize], im[kGridSize];
    analyse(*bank.transform, input, re, im);
    gather(bank, wide_step, re, im);
    scatter(bank, re, im);
    synthesise(*bank.transform, re, im, ringing);
  } else {
    for (int t = 0; t < kPeriod; t += F::kWidth) F::zero().store(ringing + t);
  }
  filter_directly(bank, wide_step, input, ringing);
}

void respond(const ResponseTable& response, const float* input, int tile, float* out) noexcept {
  constexpr int kParts = kQuantum / F::kWidth;
  constexpr int kHeld = kParts < 8 ? kParts : 8;
  for (int part = 0; part < kParts; part += kHeld) {
    F sum[kTapSets][kHeld];
#pragma GCC unroll 4
    for (int set = 0; set < kTapSets; ++set) {
#pragma GCC unroll 8
      for (int v = 0; v < kHeld; ++v) sum[set][v] = F::zero();
    }
    const int end = (tile + 1) * kQuantum;
    for (int k = 0; k < end; k += 16) {
      const float* from = response.tap[0] + kTapMargin + tile * kQuantum - k + part * F::kWidth;
      for (int shift = 0; shift < 16; shift += kTapSets) {
#pragma GCC unroll 4
        for (int set = 0; set < kTapSets; ++set) {
          const F x = F::all(input[k + shift + set]);
#pragma GCC unroll 8
          for (int v = 0; v < kHeld; ++v) {
            sum[set][v] = fma(F::load(from + (shift + set) * kTapLength + v * F::kWidth), x, sum[set][v]);
          }
        }
      }
    }
#pragma GCC unroll 8
    for (int v = 0; v < kHeld; ++v) {
#pragma GCC unroll 4
      for (int set = 1; set < kTapSets; ++set) sum[0][v] = sum[0][v] + sum[set][v];
      sum[0][v].store(out + (part + v) * F::kWidth);
    }
  }
}
