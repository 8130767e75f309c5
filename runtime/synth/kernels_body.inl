// Method:     emit is a small matrix product: a mode's sound over a sub-block is its table (32 x 2, single precision) times its state at
//             the start of the sub-block (2 x 1), so 1 to 4 starts are columns that share the table. Two sets of sums, of even and odd
//             modes, hide the latency of the FMA. advance restarts the columns every block from a state in double precision. strike is the
//             exact answer of a mode at rest to the pulse, sample by sample, with modes in the lanes; the answer's end is added to what
//             rings. drive does the same with forces that are linear between samples; when it damps, it steps what rings through the
//             sub-block too, for its sound only: the state in double precision is multiplied by the product of the factors.
// Source:     docs/decisions/resonator-kernel.md.
// Deviations: none.
//
// Included by kernels_*.cpp, which give the types F (lanes of float), D (as many lanes of double) and kVectors, kColumns: how many vectors
// of samples and how many starts emit holds in registers at once. Everything is in an unnamed namespace and nothing of std is used, so that
// no function compiled for one processor can be linked in place of another's.
// The pragmas make g++ 12 keep arrays of sums in registers.

template <int kNumber>
struct Count {
  static constexpr int count = kNumber;
};

/// Sum of kLanes numbers, half onto half; changes them.
template <int kLanes, typename Number>
inline Number add_lanes(Number* lane) noexcept {
  if constexpr (kLanes > 1) {
#pragma GCC unroll 8
    for (int l = 0; l < kLanes / 2; ++l) lane[l] += lane[l + kLanes / 2];
    return add_lanes<kLanes / 2>(lane);
  } else {
    return lane[0];
  }
}

constexpr int kTile = 8;  // groups whose tables stay in the first cache while other columns pass over them

template <int kHeld>
inline void emit_columns(const SoundTable* sound, const SubBlockStates* starts, int groups, int sub_block, int sample,
                         float* out) noexcept {
  F sum[2][kHeld][kVectors];
#pragma GCC unroll 8
  for (int q = 0; q < kHeld; ++q) {
#pragma GCC unroll 8
    for (int v = 0; v < kVectors; ++v) sum[0][q][v] = sum[1][q][v] = F::zero();
  }
  for (int g = 0; g < groups; ++g) {
    const float* table = sound[g].wave[0][0] + sample;
    const float* re = starts[g].re[sub_block];
    const float* im = starts[g].im[sub_block];
    for (int lane = 0; lane < kGroup; lane += 2) {
#pragma GCC unroll 2
      for (int odd = 0; odd < 2; ++odd) {
        F a[kVectors], b[kVectors];
#pragma GCC unroll 8
        for (int v = 0; v < kVectors; ++v) {
          a[v] = F::load(table + v * F::kWidth);
          b[v] = F::load(table + kSubBlock + v * F::kWidth);
        }
        if constexpr (kAhead > 0) {
#pragma GCC unroll 4
          for (int line = 0; line < 4; ++line) __builtin_prefetch(table + kAhead + line * 16);
        }
        table += 2 * kSubBlock;
#pragma GCC unroll 8
        for (int q = 0; q < kHeld; ++q) {
          const F x = F::all(re[q * kGroup + lane + odd]);
#pragma GCC unroll 8
          for (int v = 0; v < kVectors; ++v) sum[odd][q][v] = fma(a[v], x, sum[odd][q][v]);
        }
#pragma GCC unroll 8
        for (int q = 0; q < kHeld; ++q) {
          const F x = F::all(im[q * kGroup + lane + odd]);
#pragma GCC unroll 8
          for (int v = 0; v < kVectors; ++v) sum[odd][q][v] = fma(b[v], x, sum[odd][q][v]);
        }
      }
    }
  }
#pragma GCC unroll 8
  for (int q = 0; q < kHeld; ++q) {
#pragma GCC unroll 8
    for (int v = 0; v < kVectors; ++v) {
      float* at = out + q * kSubBlock + v * F::kWidth;
      (F::load(at) + (sum[0][q][v] + sum[1][q][v])).store(at);
    }
  }
}

inline void emit_tile(const SoundTable* sound, const SubBlockStates* starts, int groups, int first, int sub_blocks, float* out) noexcept {
  for (int k = 0; k < kSubBlock; k += kVectors * F::kWidth) {
    int q = 0;
    const auto columns = [&](auto held) {
      for (; sub_blocks - q >= held.count; q += held.count) {
        emit_columns<held.count>(sound, starts, groups, first + q, k, out + q * kSubBlock + k);
      }
    };
    columns(Count<kColumns>{});
    if constexpr (kColumns > 2) columns(Count<2>{});
    if constexpr (kColumns > 1) columns(Count<1>{});
  }
}

inline void advance_group(const RotationTable& turn, ModeState& state, SubBlockStates& starts) noexcept {
#pragma GCC unroll 2
  for (int m = 0; m < kGroup; m += F::kWidth) {
    const D re = D::load(state.re + m), im = D::load(state.im + m);
    const D turn_re = D::load(turn.block_re + m), turn_im = D::load(turn.block_im + m);
    less(re * turn_re, im, turn_im).store(state.re + m);
    more(re * turn_im, im, turn_re).store(state.im + m);
    const F x = re.narrow(), y = im.narrow();
    x.store(starts.re[0] + m);
    y.store(starts.im[0] + m);
#pragma GCC unroll 4
    for (int q = 1; q < kSubBlocks; ++q) {
      const F c = F::load(turn.sub_blocks_re[q - 1] + m), s = F::load(turn.sub_blocks_im[q - 1] + m);
      less(x * c, y, s).store(starts.re[q] + m);
      fma(x, s, y * c).store(starts.im[q] + m);
    }
  }
}

void advance(const RotationTable* turn, ModeState* state, SubBlockStates* starts, int groups) noexcept {
  for (int g = 0; g < groups; ++g) advance_group(turn[g], state[g], starts[g]);
}

void emit(const SoundTable* sound, const SubBlockStates* starts, int groups, int first, int sub_blocks, float* out) noexcept {
  for (int g = 0; g < groups; g += kTile) emit_tile(sound + g, starts + g, groups - g < kTile ? groups - g : kTile, first, sub_blocks, out);
}

void ring(const SoundTable* sound, const RotationTable* turn, ModeState* state, int groups, float* out) noexcept {
  SubBlockStates starts[kTile];
  for (int g = 0; g < groups; g += kTile) {
    const int count = groups - g < kTile ? groups - g : kTile;
    advance(turn + g, state + g, starts, count);
    emit_tile(sound + g, starts, count, 0, kSubBlocks, out);
  }
}

void strike(const StrikeTable* strike, const RotationTable* turn, const PulseBlock& touch, int sub_block, ModeState* state,
            SubBlockStates* starts, int groups, float* out) noexcept {
  alignas(64) float sum[kSubBlock * F::kWidth] = {};
  for (int m = 0; m < groups * kGroup; m += F::kWidth) {
    const int lane = m % kGroup;
    const StrikeTable& table = strike[m / kGroup];
    const RotationTable& later = turn[m / kGroup];
    ModeState& ringing = state[m / kGroup];
    SubBlockStates& start = starts[m / kGroup];
    F amplitude = F::zero();
    for (int i = 0; i < kStrikeRows; ++i) amplitude = fma(F::all(touch.weight[i]), F::convert(touch.row[i] + m), amplitude);
    amplitude = amplitude * F::load(table.scale + lane);
    const F turn_re = F::load(table.turn_re + lane), turn_im = F::load(table.turn_im + lane);
    const F out_re = F::load(table.out_re + lane), out_im = F::load(table.out_im + lane);
    F force_re[kTerms], force_im[kTerms];
#pragma GCC unroll 10
    for (int j = 0; j < kTerms; ++j) {
      force_re[j] = F::load(table.force_re[j] + lane) * amplitude;
      force_im[j] = F::load(table.force_im[j] + lane) * amplitude;
    }
    F x = F::zero(), y = F::zero();
    for (int n = touch.first; n < touch.last; ++n) {
      F fx = F::zero(), fy = F::zero();
#pragma GCC unroll 10
      for (int j = 0; j < kTerms; ++j) {
        const F moment = F::all(touch.moment[n][j]);
        fx = fma(moment, force_re[j], fx);
        fy = fma(moment, force_im[j], fy);
      }
      const F turned = less(fma(x, turn_re, fx), y, turn_im);
      y = fma(x, turn_im, fma(y, turn_re, fy));
      x = turned;
      float* at = sum + n * F::kWidth;
      fma(out_re, x, fma(out_im, y, F::load(at))).store(at);
    }
    for (int n = touch.last; n < kSubBlock; ++n) {
      const F turned = less(x * turn_re, y, turn_im);
      y = fma(x, turn_im, y * turn_re);
      x = turned;
      float* at = sum + n * F::kWidth;
      fma(out_re, x, fma(out_im, y, F::load(at))).store(at);
    }
    // At the start of the next sub-block, and from there on.
    const F re = less(x * turn_re, y, turn_im), im = fma(x, turn_im, y * turn_re);
    for (int q = sub_block + 1; q <= kSubBlocks; ++q) {
      F later_re = re, later_im = im;
      if (const int ahead = q - sub_block - 1; ahead > 0) {
        const F c = F::load(later.sub_blocks_re[ahead - 1] + lane), s = F::load(later.sub_blocks_im[ahead - 1] + lane);
        later_re = less(re * c, im, s);
        later_im = fma(re, s, im * c);
      }
      if (q < kSubBlocks) {
        (F::load(start.re[q] + lane) + later_re).store(start.re[q] + lane);
        (F::load(start.im[q] + lane) + later_im).store(start.im[q] + lane);
      } else {
        (D::load(ringing.re + lane) + D::widen(later_re)).store(ringing.re + lane);
        (D::load(ringing.im + lane) + D::widen(later_im)).store(ringing.im + lane);
      }
    }
  }
  for (int n = 0; n < kSubBlock; ++n) out[n] += add_lanes<F::kWidth>(sum + n * F::kWidth);
}

/// A mode's damping over a sample by one end of all contacts, as the contract of Kernels::drive has it.
inline F calc_damping(const ContactBlock& drive, int end, int mode, F scale, F angle) noexcept {
  F x = F::zero();
  for (int c = 0; c < drive.contacts; ++c) {
    const ContactEnd& push = drive.push[c][end];
    F along = F::zero();
    for (int i = 0; i < kStrikeRows; ++i) along = fma(F::all(push.damping[i]), F::convert(push.row[i] + mode), along);
    along = along * scale;
    const F taken = along * along, spring = F::all(push.give) * taken;
    x = x + taken + F::all(push.half_loss) * angle * spring / (angle * angle + spring + F::all(1e-30F));
  }
  x = x * angle / (angle + x + F::all(1e-30F));
  const F p = fma(fma(x, F::all(1.0F / 6.0F), F::all(0.5F)), x * x, x);
  return p / (F::all(1.0F) + p);
}

template <bool kForces, bool kDamps>
inline void drive_modes(const StrikeTable* strike, const RotationTable* turn, const ContactBlock& drive, int sub_block, ModeState* state,
                        SubBlockStates* starts, int groups, float* out) noexcept {
  alignas(64) float sum[kSubBlock * F::kWidth] = {};
  for (int m = 0; m < groups * kGroup; m += F::kWidth) {
    const int lane = m % kGroup;
    const StrikeTable& table = strike[m / kGroup];
    const RotationTable& later = turn[m / kGroup];
    ModeState& ringing = state[m / kGroup];
    SubBlockStates& start = starts[m / kGroup];
    const F scale = F::load(table.scale + lane);
    const F turn_re = F::load(table.turn_re + lane), turn_im = F::load(table.turn_im + lane);
    const F out_re = F::load(table.out_re + lane), out_im = F::load(table.out_im + lane);
    F force[kSubBlock + 1];
    F first_re = F::zero(), first_im = F::zero(), second_re = F::zero(), second_im = F::zero();  // answers to 1 - u and u
    if constexpr (kForces) {
      for (int n = 0; n <= kSubBlock; ++n) force[n] = F::zero();
      for (int c = 0; c < drive.contacts; ++c) {
        for (int end = 0; end < 2; ++end) {
          const ContactEnd& push = drive.push[c][end];
          if (!push.forces) continue;
          F amplitude = F::zero();
          for (int i = 0; i < kStrikeRows; ++i) amplitude = fma(F::all(push.force[i]), F::convert(push.row[i] + m), amplitude);
          amplitude = amplitude * scale;
          for (int n = 0; n <= kSubBlock; ++n) force[n] = fma(F::all(push.signal[n]), amplitude, force[n]);
        }
      }
      for (int j = 0; j < kTerms; ++j) {
        const F re = F::load(table.force_re[j] + lane), im = F::load(table.force_im[j] + lane);
        first_re = fma(F::all(drive.ramp[0][j]), re, first_re);
        first_im = fma(F::all(drive.ramp[0][j]), im, first_im);
        second_re = fma(F::all(drive.ramp[1][j]), re, second_re);
        second_im = fma(F::all(drive.ramp[1][j]), im, second_im);
      }
    }
    F damping = F::zero(), last_damping = F::zero();
    F ring_re = F::zero(), ring_im = F::zero();  // what rings already, while it is damped
    D kept = D::all(1.0);                        // of its amplitude
    if constexpr (kDamps) {
      const F angle = F::load(table.angle + lane);
      damping = calc_damping(drive, 0, m, scale, angle);
      last_damping = calc_damping(drive, 1, m, scale, angle);
      ring_re = F::load(start.re[sub_block] + lane);
      ring_im = F::load(start.im[sub_block] + lane);
      fma(out_re, ring_re, fma(out_im, ring_im, F::load(sum))).store(sum);
    }
    F x = F::zero(), y = F::zero();  // what the force makes
    for (int n = 1; n <= kSubBlock; ++n) {
      F keep = F::zero();
      if constexpr (kDamps) {
        const float share = (static_cast<float>(n) - 0.5F) / kSubBlock;
        const F lost = fma(F::all(share), last_damping, F::all(1.0F - share) * damping);
        keep = less(F::all(1.0F), F::all(1.0F), lost);
        const F re = less(ring_re * turn_re, ring_im, turn_im) * keep, im = fma(ring_re, turn_im, ring_im * turn_re) * keep;
        ring_re = re;
        ring_im = im;
        kept = less(kept, kept, D::widen(lost));
      }
      if constexpr (kForces) {
        F re = less(x * turn_re, y, turn_im), im = fma(x, turn_im, y * turn_re);
        if constexpr (kDamps) {
          re = re * keep;
          im = im * keep;
        }
        x = fma(first_re, force[n - 1], fma(second_re, force[n], re));
        y = fma(first_im, force[n - 1], fma(second_im, force[n], im));
      }
      if (n < kSubBlock) {
        float* at = sum + n * F::kWidth;
        fma(out_re, x + ring_re, fma(out_im, y + ring_im, F::load(at))).store(at);
      }
    }
    for (int q = sub_block + 1; q <= kSubBlocks; ++q) {
      F later_re = x, later_im = y;
      if (const int ahead = q - sub_block - 1; ahead > 0) {
        const F c = F::load(later.sub_blocks_re[ahead - 1] + lane), s = F::load(later.sub_blocks_im[ahead - 1] + lane);
        later_re = less(x * c, y, s);
        later_im = fma(x, s, y * c);
      }
      if (q < kSubBlocks) {
        F re = F::load(start.re[q] + lane), im = F::load(start.im[q] + lane);
        if constexpr (kDamps) {
          re = re * kept.narrow();
          im = im * kept.narrow();
        }
        (re + later_re).store(start.re[q] + lane);
        (im + later_im).store(start.im[q] + lane);
      } else {
        D re = D::load(ringing.re + lane), im = D::load(ringing.im + lane);
        if constexpr (kDamps) {
          re = re * kept;
          im = im * kept;
        }
        (re + D::widen(later_re)).store(ringing.re + lane);
        (im + D::widen(later_im)).store(ringing.im + lane);
      }
    }
  }
  for (int n = 0; n < kSubBlock; ++n) out[n] += add_lanes<F::kWidth>(sum + n * F::kWidth);
}

void drive(const StrikeTable* strike, const RotationTable* turn, const ContactBlock& what, int sub_block, ModeState* state,
           SubBlockStates* starts, int groups, float* out) noexcept {
  if (what.forces && what.damps)
    drive_modes<true, true>(strike, turn, what, sub_block, state, starts, groups, out);
  else if (what.forces)
    drive_modes<true, false>(strike, turn, what, sub_block, state, starts, groups, out);
  else if (what.damps)
    drive_modes<false, true>(strike, turn, what, sub_block, state, starts, groups, out);
}
