// Inner loops over modes, selected by instruction set at run time.
//
// Modes come in groups of kGroup; empty lanes have zero tables.
#pragma once

#include <array>
#include <cstdint>

#include "runtime/base/instructions.hpp"

namespace carillon::synth {

inline constexpr int kGroup = 16;       // modes stored and culled together
inline constexpr int kSubBlock = 32;    // samples: time grid of all changes
inline constexpr int kBlock = 128;      // samples per step of the double-precision state
inline constexpr int kSubBlocks = 4;    // in a block
inline constexpr int kColumn = 16;      // samples per table
inline constexpr int kColumns = 8;      // in a block
inline constexpr int kTerms = 10;       // Chebyshev terms of a strike: -169 dB at the Nyquist frequency
inline constexpr int kStrikeRows = 9;   // three corners times three axes
inline constexpr int kMaxContacts = 8;  // active contacts per body

using Isa = base::Instructions;
using base::get_name;

/// Sound of each mode over a column: sample k of mode m is re wave[m / 2][0][k][m % 2] + im wave[m / 2][1][k][m % 2] for the state re + i
/// im at the start of the column.
struct alignas(64) SoundTable {
  float wave[kGroup / 2][2][kColumn][2];
};

/// Free rotation of each mode.
struct alignas(64) RotationTable {
  double block_re[kGroup], block_im[kGroup];           // over kBlock samples
  float columns_re[3][kGroup], columns_im[3][kGroup];  // over 1, 2 and 4 columns
};

/// Response of each mode to a strike.
struct alignas(64) StrikeTable {
  float turn_re[kGroup], turn_im[kGroup];                    // over one sample
  float out_re[kGroup], out_im[kGroup];                      // pressure = out_re re + out_im im
  float scale[kGroup];                                       // scale of the rows of a PulseBlock or a ContactEnd
  float angle[kGroup];                                       // omega over one sample [rad]
  float force_re[kTerms][kGroup], force_im[kTerms][kGroup];  // Chebyshev coefficients of the response within a sample
};

/// State of each mode at the start of the next block.
struct alignas(64) ModeState {
  double re[kGroup], im[kGroup];
};

/// State of each mode at the start of each column of this block.
struct alignas(64) ColumnStates {
  float re[kColumns][kGroup], im[kColumns][kGroup];
};

/// Complex weight of each mode.
struct alignas(64) ModeWeight {
  float re[kGroup], im[kGroup];
};

/// Response of each mode to forces at each sample of a sub-block.
struct alignas(64) SampleStates {
  float re[kSubBlock][kGroup], im[kSubBlock][kGroup];
};

/// A pulse within one sub-block.
struct PulseBlock {
  const std::int16_t* row[kStrikeRows];  // [mode]
  float weight[kStrikeRows];
  int first, last;  // the pulse acts on samples first <= n < last
  float moment[kSubBlock][kTerms];
};

/// One end of a contact's action in a sub-block: at its first sample, or the first one after it.
struct ContactEnd {
  const std::int16_t* row[kStrikeRows];  // [mode]
  float force[kStrikeRows];              // times row and signal: force on a mode
  float damping[kStrikeRows];            // times row, squared: damping of a mode over a sample
  float give, half_loss;                 // b, the same, makes b give / (angle^2 + b give) the contact spring's share of the energy, and
                                         // angle times half_loss times that the damping by the spring
  float signal[kSubBlock + 1];           // N, at each sample of the sub-block and the first one after it; linear in between
  bool forces;                           // signal is not all zero
};

/// Contacts of a body in one sub-block. Forces of both ends add; damping goes from the first end to the second.
struct ContactBlock {
  std::array<ContactEnd, 2> push[kMaxContacts];
  int contacts;
  bool forces, damps;     // any force, any damping
  float strength_n_s;     // bound on the impulse in the sub-block
  float ramp[2][kTerms];  // moments of 1 - u and of u, times the length of a sample [s]
};

inline constexpr int kTaps = 32;  // samples read per output sample

/// One output sample of an ear: sum of weight[k] source[k], with taps interpolated between `taps` and the following kTaps.
struct Reading {
  const float* taps;
  float mix;  // 0: first taps, 1: following taps
  int sources;
  const float* source[4];  // kTaps each
  float weight[4];
};

struct Kernels {
  Isa isa;
  /// Fills the starts of a block and advances the state to the start of the next.
  void (*advance)(const RotationTable* turn, ModeState* state, ColumnStates* starts, int groups) noexcept;
  /// Adds the sound of `sub_blocks` (1 to kSubBlocks) sub-blocks from `first` on to out, sub-blocks x kSubBlock samples. The division into
  /// calls does not change the bits.
  void (*emit)(const SoundTable* sound, const ColumnStates* starts, int groups, int first, int sub_blocks, float* out) noexcept;
  /// advance() and emit() of the whole block, with the same bits, without storing the starts.
  void (*ring)(const SoundTable* sound, const RotationTable* turn, ModeState* state, int groups, float* out) noexcept;
  /// Adds the response to a pulse in one sub-block to out, kSubBlock samples, and its final state to the starts and the state.
  void (*strike)(const StrikeTable* strike, const RotationTable* turn, const PulseBlock& touch, int sub_block, ModeState* state,
                 ColumnStates* starts, int groups, float* out) noexcept;
  /// Adds the response to contacts in one sub-block to out, kSubBlock samples, and its final state to the starts and the state. With
  /// damping that is all the sound of the sub-block (no emit), and every mode's amplitude is multiplied at each sample by 1 - e <= 1, e = p
  /// / (1 + p), p = x + x^2 / 2 + x^3 / 6, which is 1 - exp(-x) to x^4 / 24, x the sum of the contacts' dampings, limited to the mode's
  /// angle; e is linear between both ends.
  void (*drive)(const StrikeTable* strike, const RotationTable* turn, const ContactBlock& drive, int sub_block, ModeState* state,
                ColumnStates* starts, int groups, float* out) noexcept;
  /// emit() of weighted starts.
  void (*emit_weighted)(const SoundTable* sound, const ColumnStates* starts, const ModeWeight* weight, int groups, int first,
                        int sub_blocks, float* out) noexcept;
  /// strike() and drive(), with the same bits, which also add the states of the response to `kept`.
  void (*strike_and_keep)(const StrikeTable* strike, const RotationTable* turn, const PulseBlock& touch, int sub_block, ModeState* state,
                          ColumnStates* starts, int groups, float* out, SampleStates* kept) noexcept;
  void (*drive_and_keep)(const StrikeTable* strike, const RotationTable* turn, const ContactBlock& drive, int sub_block, ModeState* state,
                         ColumnStates* starts, int groups, float* out, SampleStates* kept) noexcept;
  /// Adds the real parts of weight times kept state, summed over modes, to out, kSubBlock samples.
  void (*weigh)(const ModeWeight* weight, const SampleStates* kept, int groups, float* out) noexcept;
  /// Convolution with constant taps: kTaps + kSubBlock - 1 samples to kSubBlock.
  void (*convolve)(const float* taps, const float* samples, float* out) noexcept;
  /// Reading with varying taps.
  void (*read)(const Reading* readings, int count, float* out) noexcept;
};

/// Kernels of an instruction set, or of the best one below it that the processor has. Any thread.
const Kernels& get_kernels(Isa isa) noexcept;

}  // namespace carillon::synth
