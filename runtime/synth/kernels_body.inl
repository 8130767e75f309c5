// Method:     emit is a small matrix product: a mode's sound over 16 samples is its table (16 x 2, single precision) times its state at
//             their start (2 x 1), so the eight starts of a block are columns that share the table. Modes go in pairs: a vector of the
//             table holds the samples of two modes in turn, and one load of 64 bits, repeated, is the states of both; their sums are
//             added at the end. advance restarts the columns every block from a state in double precision; three turns, over 1, 2 and
//             4 columns, make all eight. strike is the exact answer of a mode at rest to the pulse, sample by sample, with modes in the
//             lanes; the answer's end is added to what rings. drive does the same with forces that are linear between samples; when it
//             damps, it steps what rings through the sub-block too, for its sound only: the state in double precision is multiplied by
//             the product of the factors.
// Source:     docs/decisions/resonator-kernel.md.
//
// Included by kernels.cpp once per instruction set, which gives the types F (lanes of float), D (as many lanes of double), P (lanes of
// float in pairs) and kVectors, kHeldColumns: how many vectors of samples of how many columns emit holds in registers at once. The pragmas
// make g++ 12 keep arrays of sums in registers.

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

constexpr int kEach = kSubBlock / kColumn;  // columns of a sub-block
constexpr int kTile = 8;         // groups that are summed by themselves; their tables stay in the first cache while columns pass over them
constexpr int kStatesAhead = 8;  // groups whose states are called for early: those of many voices come from the third cache

/// Sums over modes, of even and odd modes apart.
struct alignas(64) Sums {
  float of[kColumns][kColumn][2];
};

/// The sums of kHeld columns in registers, kVectors vectors of samples of each.
template <int kHeld>
struct Held {
  P sum[kHeld][kVectors];

  [[gnu::always_inline]] void clear() noexcept {
#pragma GCC unroll 8
    for (int q = 0; q < kHeld; ++q) {
#pragma GCC unroll 8
      for (int v = 0; v < kVectors; ++v) sum[q][v] = P::zero();
    }
  }
  /// Puts the sums of the first tile there, and adds those of others.
  [[gnu::always_inline]] void put(float* sums, bool is_first) const noexcept {
#pragma GCC unroll 8
    for (int q = 0; q < kHeld; ++q) {
#pragma GCC unroll 8
      for (int v = 0; v < kVectors; ++v) {
        float* at = sums + q * 2 * kColumn + v * P::kWidth;
        (is_first ? sum[q][v] : P::load(at) + sum[q][v]).store(at);
      }
    }
  }
  /// Adds what one part of the states of two modes sounds.
  [[gnu::always_inline]] void add_part(const float* table, const float* states) noexcept {
    // The fewer of the two, vectors of the table and columns, stay in registers.
    if constexpr (kHeld > kVectors) {
      P a[kVectors];
#pragma GCC unroll 8
      for (int v = 0; v < kVectors; ++v) a[v] = P::load(table + v * P::kWidth);
#pragma GCC unroll 8
      for (int q = 0; q < kHeld; ++q) {
        const P x = P::pair(states + q * kGroup);
#pragma GCC unroll 8
        for (int v = 0; v < kVectors; ++v) sum[q][v] = fma(a[v], x, sum[q][v]);
      }
    } else {
      P x[kHeld];
#pragma GCC unroll 8
      for (int q = 0; q < kHeld; ++q) x[q] = P::pair(states + q * kGroup);
#pragma GCC unroll 8
      for (int v = 0; v < kVectors; ++v) {
        const P a = P::load(table + v * P::kWidth);
#pragma GCC unroll 8
        for (int q = 0; q < kHeld; ++q) sum[q][v] = fma(a, x[q], sum[q][v]);
      }
    }
  }
  /// Adds a group, from a column and a sample of the column on.
  [[gnu::always_inline]] void add(const SoundTable& sound, const ColumnStates& starts, int column, int sample) noexcept {
#pragma GCC unroll 2
    for (int m = 0; m < kGroup; m += 2) {
      add_part(sound.wave[m / 2][0][sample], starts.re[column] + m);
      add_part(sound.wave[m / 2][1][sample], starts.im[column] + m);
    }
  }
};

/// Adds kHeld columns of a tile, from `column` and from `sample` of them on.
template <int kHeld>
inline void add_columns(const SoundTable* sound, const ColumnStates* starts, int groups, int column, int sample, bool is_first,
                        float* sums) noexcept {
  Held<kHeld> held;
  held.clear();
  for (int g = 0; g < groups; ++g) held.add(sound[g], starts[g], column, sample);
  held.put(sums, is_first);
}

/// Adds `columns` columns of a tile, from `first` on.
inline void add_tile(const SoundTable* sound, const ColumnStates* starts, int groups, int first, int columns, bool is_first,
                     Sums& sums) noexcept {
  for (int k = 0; k < kColumn; k += kVectors * P::kWidth / 2) {
    int q = 0;
    const auto add = [&](auto held) HWY_ATTR {
      // Two pairs rather than three and one.
      for (; columns - q >= held.count && (held.count != 3 || columns - q != 4); q += held.count) {
        add_columns<held.count>(sound, starts, groups, first + q, k, is_first, sums.of[q][k]);
      }
    };
    add(Count<kHeldColumns>{});
    if constexpr (kHeldColumns > 4) add(Count<4>{});
    if constexpr (kHeldColumns > 2) add(Count<2>{});
  }
}

/// The sums of even and odd modes together, added to the samples.
inline void add_sums(const Sums& sums, int columns, float* out) noexcept {
  const float* sum = sums.of[0][0];
  for (int n = 0; n < columns * kColumn; ++n) out[n] += sum[2 * n] + sum[2 * n + 1];
}

/// The states of the modes in the lanes from `lane` on after 0 to kColumns - 1 columns, left to themselves.
struct Turned {
  F re[kColumns], im[kColumns];
  Turned(const RotationTable& turn, int lane, F x, F y) noexcept {
    re[0] = x;
    im[0] = y;
#pragma GCC unroll 3
    for (int i = 0; i < 3; ++i) {
      const F c = F::load(turn.columns_re[i] + lane), s = F::load(turn.columns_im[i] + lane);
      const int known = 1 << i;
#pragma GCC unroll 4
      for (int q = 0; q < known; ++q) {
        re[known + q] = less(re[q] * c, im[q], s);
        im[known + q] = fma(re[q], s, im[q] * c);
      }
    }
  }
};

inline void advance_group(const RotationTable& turn, ModeState& state, ColumnStates& starts) noexcept {
#pragma GCC unroll 2
  for (int m = 0; m < kGroup; m += F::kWidth) {
    const D re = D::load(state.re + m), im = D::load(state.im + m);
    const D turn_re = D::load(turn.block_re + m), turn_im = D::load(turn.block_im + m);
    less(re * turn_re, im, turn_im).store(state.re + m);
    more(re * turn_im, im, turn_re).store(state.im + m);
    const Turned turned(turn, m, re.narrow(), im.narrow());
#pragma GCC unroll 8
    for (int q = 0; q < kColumns; ++q) {
      turned.re[q].store(starts.re[q] + m);
      turned.im[q].store(starts.im[q] + m);
    }
  }
}

/// Has a state come to the first cache.
inline void call_for(const ModeState& state) noexcept {
#pragma GCC unroll 4
  for (int m = 0; m < kGroup; m += 8) {
    __builtin_prefetch(state.re + m, 1);
    __builtin_prefetch(state.im + m, 1);
  }
}

void advance(const RotationTable* turn, ModeState* state, ColumnStates* starts, int groups) noexcept {
  for (int g = 0; g < groups; ++g) {
    if (g + kStatesAhead < groups) call_for(state[g + kStatesAhead]);
    advance_group(turn[g], state[g], starts[g]);
  }
}

void emit(const SoundTable* sound, const ColumnStates* starts, int groups, int first, int sub_blocks, float* out) noexcept {
  if (groups == 0) return;
  Sums sums;
  for (int g = 0; g < groups; g += kTile)
    add_tile(sound + g, starts + g, groups - g < kTile ? groups - g : kTile, first * kEach, sub_blocks * kEach, g == 0, sums);
  add_sums(sums, sub_blocks * kEach, out);
}

void emit_weighted(const SoundTable* sound, const ColumnStates* starts, const ModeWeight* weight, int groups, int first, int sub_blocks,
                   float* out) noexcept {
  if (groups == 0) return;
  Sums sums;
  ColumnStates weighted[kTile];
  const int begin = first * kEach, end = begin + sub_blocks * kEach;
  for (int tile = 0; tile < groups; tile += kTile) {
    const int count = groups - tile < kTile ? groups - tile : kTile;
    for (int g = 0; g < count; ++g) {
      const ColumnStates& from = starts[tile + g];
#pragma GCC unroll 2
      for (int m = 0; m < kGroup; m += F::kWidth) {
        const F c = F::load(weight[tile + g].re + m), s = F::load(weight[tile + g].im + m);
        for (int q = begin; q < end; ++q) {
          const F re = F::load(from.re[q] + m), im = F::load(from.im[q] + m);
          less(re * c, im, s).store(weighted[g].re[q] + m);
          fma(re, s, im * c).store(weighted[g].im[q] + m);
        }
      }
    }
    add_tile(sound + tile, weighted, count, begin, end - begin, tile == 0, sums);
  }
  add_sums(sums, end - begin, out);
}

void weigh(const ModeWeight* weight, const SampleStates* kept, int groups, float* out) noexcept {
  for (int n = 0; n < kSubBlock; ++n) {
    F sum = F::zero();
    for (int g = 0; g < groups; ++g) {
      for (int m = 0; m < kGroup; m += F::kWidth) {
        sum = fma(F::load(weight[g].re + m), F::load(kept[g].re[n] + m), sum);
        sum = less(sum, F::load(weight[g].im + m), F::load(kept[g].im[n] + m));
      }
    }
    float lane[F::kWidth];
    sum.store(lane);
    out[n] += add_lanes<F::kWidth>(lane);
  }
}

/// Adds to the states of a sample those of the modes in the lanes from `lane` on.
inline void keep(SampleStates& kept, int sample, int lane, F re, F im) noexcept {
  (F::load(kept.re[sample] + lane) + re).store(kept.re[sample] + lane);
  (F::load(kept.im[sample] + lane) + im).store(kept.im[sample] + lane);
}

void ring(const SoundTable* sound, const RotationTable* turn, ModeState* state, int groups, float* out) noexcept {
  if (groups == 0) return;
  for (int g = 0; g < groups && g < kStatesAhead; ++g) call_for(state[g]);
  Sums sums;
  if constexpr (kHeldColumns == kColumns && kVectors * P::kWidth == 2 * kColumn) {
    // All sums are in registers: the next group is advanced while one sounds.
    ColumnStates starts[2];
    advance_group(turn[0], state[0], starts[0]);
    Held<kColumns> held;
    for (int tile = 0; tile < groups; tile += kTile) {
      held.clear();
      for (int g = tile; g < groups && g < tile + kTile; ++g) {
        if (g + kStatesAhead < groups) call_for(state[g + kStatesAhead]);
        if (g + 1 < groups) advance_group(turn[g + 1], state[g + 1], starts[(g + 1) % 2]);
        held.add(sound[g], starts[g % 2], 0, 0);
      }
      held.put(sums.of[0][0], tile == 0);
    }
  } else {
    ColumnStates starts[kTile];
    for (int tile = 0; tile < groups; tile += kTile) {
      const int count = groups - tile < kTile ? groups - tile : kTile;
      for (int g = 0; g < count; ++g) {
        if (tile + g + kStatesAhead < groups) call_for(state[tile + g + kStatesAhead]);
        advance_group(turn[tile + g], state[tile + g], starts[g]);
      }
      add_tile(sound + tile, starts, count, 0, kColumns, tile == 0, sums);
    }
  }
  add_sums(sums, kColumns, out);
}

/// Adds what an answer is at the start of the next sub-block to the starts from there on, and to the state after the block.
inline void add_later(const RotationTable& turn, int lane, F x, F y, int sub_block, ModeState& ringing, ColumnStates& start) noexcept {
  const Turned later(turn, lane, x, y);
  const int first = (sub_block + 1) * kEach;
  for (int q = first; q < kColumns; ++q) {
    (F::load(start.re[q] + lane) + later.re[q - first]).store(start.re[q] + lane);
    (F::load(start.im[q] + lane) + later.im[q - first]).store(start.im[q] + lane);
  }
  (D::load(ringing.re + lane) + D::widen(later.re[kColumns - first])).store(ringing.re + lane);
  (D::load(ringing.im + lane) + D::widen(later.im[kColumns - first])).store(ringing.im + lane);
}

template <bool kKeeps>
inline void strike_modes(const StrikeTable* strike, const RotationTable* turn, const PulseBlock& touch, int sub_block, ModeState* state,
                         ColumnStates* starts, int groups, float* out, SampleStates* kept) noexcept {
  alignas(64) float sum[kSubBlock * F::kWidth] = {};
  for (int m = 0; m < groups * kGroup; m += F::kWidth) {
    const int lane = m % kGroup;
    const StrikeTable& table = strike[m / kGroup];
    const RotationTable& later = turn[m / kGroup];
    ModeState& ringing = state[m / kGroup];
    ColumnStates& start = starts[m / kGroup];
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
      if constexpr (kKeeps) keep(kept[m / kGroup], n, lane, x, y);
    }
    for (int n = touch.last; n < kSubBlock; ++n) {
      const F turned = less(x * turn_re, y, turn_im);
      y = fma(x, turn_im, y * turn_re);
      x = turned;
      float* at = sum + n * F::kWidth;
      fma(out_re, x, fma(out_im, y, F::load(at))).store(at);
      if constexpr (kKeeps) keep(kept[m / kGroup], n, lane, x, y);
    }
    // At the start of the next sub-block, and from there on.
    const F re = less(x * turn_re, y, turn_im), im = fma(x, turn_im, y * turn_re);
    add_later(later, lane, re, im, sub_block, ringing, start);
  }
  for (int n = 0; n < kSubBlock; ++n) out[n] += add_lanes<F::kWidth>(sum + n * F::kWidth);
}

void strike(const StrikeTable* strike, const RotationTable* turn, const PulseBlock& touch, int sub_block, ModeState* state,
            ColumnStates* starts, int groups, float* out) noexcept {
  strike_modes<false>(strike, turn, touch, sub_block, state, starts, groups, out, nullptr);
}

void strike_and_keep(const StrikeTable* strike, const RotationTable* turn, const PulseBlock& touch, int sub_block, ModeState* state,
                     ColumnStates* starts, int groups, float* out, SampleStates* kept) noexcept {
  strike_modes<true>(strike, turn, touch, sub_block, state, starts, groups, out, kept);
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

/// Forces of all contacts on a vector of modes, at the samples of a sub-block and the first of the next.
inline void calc_forces(const ContactBlock& drive, int m, F scale, F* force) noexcept {
  for (int n = 0; n <= kSubBlock; ++n) force[n] = F::zero();
  for (int c = 0; c < drive.contacts; ++c) {
    for (const ContactEnd& push : drive.push[c]) {
      if (!push.forces) continue;
      F amplitude = F::zero();
      for (int i = 0; i < kStrikeRows; ++i) amplitude = fma(F::all(push.force[i]), F::convert(push.row[i] + m), amplitude);
      amplitude = amplitude * scale;
      for (int n = 0; n <= kSubBlock; ++n) force[n] = fma(F::all(push.signal[n]), amplitude, force[n]);
    }
  }
}

template <bool kForces, bool kDamps, bool kKeeps>
inline void drive_modes(const StrikeTable* strike, const RotationTable* turn, const ContactBlock& drive, int sub_block, ModeState* state,
                        ColumnStates* starts, int groups, float* out, SampleStates* kept) noexcept {
  alignas(64) float sum[kSubBlock * F::kWidth] = {};
  for (int m = 0; m < groups * kGroup; m += F::kWidth) {
    const int lane = m % kGroup;
    const StrikeTable& table = strike[m / kGroup];
    const RotationTable& later = turn[m / kGroup];
    ModeState& ringing = state[m / kGroup];
    ColumnStates& start = starts[m / kGroup];
    const F scale = F::load(table.scale + lane);
    const F turn_re = F::load(table.turn_re + lane), turn_im = F::load(table.turn_im + lane);
    const F out_re = F::load(table.out_re + lane), out_im = F::load(table.out_im + lane);
    F force[kSubBlock + 1];
    F first_re = F::zero(), first_im = F::zero(), second_re = F::zero(), second_im = F::zero();  // answers to 1 - u and u
    if constexpr (kForces) {
      calc_forces(drive, m, scale, force);
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
    D left = D::all(1.0);                        // of its amplitude
    if constexpr (kDamps) {
      const F angle = F::load(table.angle + lane);
      damping = calc_damping(drive, 0, m, scale, angle);
      last_damping = calc_damping(drive, 1, m, scale, angle);
      ring_re = F::load(start.re[sub_block * kEach] + lane);
      ring_im = F::load(start.im[sub_block * kEach] + lane);
      fma(out_re, ring_re, fma(out_im, ring_im, F::load(sum))).store(sum);
      if constexpr (kKeeps) keep(kept[m / kGroup], 0, lane, ring_re, ring_im);
    }
    F x = F::zero(), y = F::zero();  // what the force makes
    for (int n = 1; n <= kSubBlock; ++n) {
      F keeps = F::zero();
      if constexpr (kDamps) {
        const float share = (static_cast<float>(n) - 0.5F) / kSubBlock;
        const F lost = fma(F::all(share), last_damping, F::all(1.0F - share) * damping);
        keeps = less(F::all(1.0F), F::all(1.0F), lost);
        const F re = less(ring_re * turn_re, ring_im, turn_im) * keeps, im = fma(ring_re, turn_im, ring_im * turn_re) * keeps;
        ring_re = re;
        ring_im = im;
        left = less(left, left, D::widen(lost));
      }
      if constexpr (kForces) {
        F re = less(x * turn_re, y, turn_im), im = fma(x, turn_im, y * turn_re);
        if constexpr (kDamps) {
          re = re * keeps;
          im = im * keeps;
        }
        x = fma(first_re, force[n - 1], fma(second_re, force[n], re));
        y = fma(first_im, force[n - 1], fma(second_im, force[n], im));
      }
      if (n < kSubBlock) {
        float* at = sum + n * F::kWidth;
        fma(out_re, x + ring_re, fma(out_im, y + ring_im, F::load(at))).store(at);
        if constexpr (kKeeps) keep(kept[m / kGroup], n, lane, x + ring_re, y + ring_im);
      }
    }
    if constexpr (kDamps) {
      const F keeps = left.narrow();
      for (int q = (sub_block + 1) * kEach; q < kColumns; ++q) {
        (F::load(start.re[q] + lane) * keeps).store(start.re[q] + lane);
        (F::load(start.im[q] + lane) * keeps).store(start.im[q] + lane);
      }
      (D::load(ringing.re + lane) * left).store(ringing.re + lane);
      (D::load(ringing.im + lane) * left).store(ringing.im + lane);
    }
    if constexpr (kForces) add_later(later, lane, x, y, sub_block, ringing, start);
  }
  for (int n = 0; n < kSubBlock; ++n) out[n] += add_lanes<F::kWidth>(sum + n * F::kWidth);
}

template <bool kKeeps>
inline void drive_any(const StrikeTable* strike, const RotationTable* turn, const ContactBlock& what, int sub_block, ModeState* state,
                      ColumnStates* starts, int groups, float* out, SampleStates* kept) noexcept {
  if (what.forces && what.damps)
    drive_modes<true, true, kKeeps>(strike, turn, what, sub_block, state, starts, groups, out, kept);
  else if (what.forces)
    drive_modes<true, false, kKeeps>(strike, turn, what, sub_block, state, starts, groups, out, kept);
  else if (what.damps)
    drive_modes<false, true, kKeeps>(strike, turn, what, sub_block, state, starts, groups, out, kept);
}

void drive(const StrikeTable* strike, const RotationTable* turn, const ContactBlock& what, int sub_block, ModeState* state,
           ColumnStates* starts, int groups, float* out) noexcept {
  drive_any<false>(strike, turn, what, sub_block, state, starts, groups, out, nullptr);
}

void drive_and_keep(const StrikeTable* strike, const RotationTable* turn, const ContactBlock& what, int sub_block, ModeState* state,
                    ColumnStates* starts, int groups, float* out, SampleStates* kept) noexcept {
  drive_any<true>(strike, turn, what, sub_block, state, starts, groups, out, kept);
}
