// The inner loops over modes, one implementation for every instruction set, chosen when a voice is made.
//
// Modes come in groups of kGroup; lanes that hold no mode have zero tables. Each source file of an instruction set is compiled with flags
// of its own, so nothing here may be an inline function.
#pragma once

#include <array>
#include <cstdint>

namespace carillon::synth {

inline constexpr int kGroup = 16;       // modes that are stored and culled together
inline constexpr int kSubBlock = 32;    // samples: the grid on which anything may change
inline constexpr int kBlock = 128;      // samples between two steps of the double-precision state
inline constexpr int kSubBlocks = 4;    // in a block
inline constexpr int kColumn = 16;      // samples of one table
inline constexpr int kColumns = 8;      // in a block
inline constexpr int kTerms = 10;       // Chebyshev terms of a strike: -169 dB at the Nyquist frequency
inline constexpr int kStrikeRows = 9;   // three corners times three directions
inline constexpr int kMaxContacts = 8;  // that drive a body at once

/// Instruction sets, least first. kBest stands for the last one that the processor has. kSimd128 is WebAssembly's.
enum class Isa : std::uint8_t { kPlain, kSimd128, kSse2, kAvx2, kAvx512, kBest };

/// The sound of each mode over a column: sample k of mode m is re wave[m / 2][0][k][m % 2] + im wave[m / 2][1][k][m % 2] when the column
/// begins in the state re + i im.
struct alignas(64) SoundTable {
  float wave[kGroup / 2][2][kColumn][2];
};

/// How each mode turns while nothing drives it.
struct alignas(64) RotationTable {
  double block_re[kGroup], block_im[kGroup];           // over kBlock samples
  float columns_re[3][kGroup], columns_im[3][kGroup];  // over 1, 2 and 4 columns
};

/// How each mode answers a strike.
struct alignas(64) StrikeTable {
  float turn_re[kGroup], turn_im[kGroup];                    // over one sample
  float out_re[kGroup], out_im[kGroup];                      // pressure = out_re re + out_im im
  float scale[kGroup];                                       // of the rows of a PulseBlock or a ContactEnd
  float angle[kGroup];                                       // omega over one sample [rad]
  float force_re[kTerms][kGroup], force_im[kTerms][kGroup];  // Chebyshev coefficients of the answer within a sample
};

/// The state of each mode at the start of the next block.
struct alignas(64) ModeState {
  double re[kGroup], im[kGroup];
};

/// The state of each mode at the start of each column of this block.
struct alignas(64) ColumnStates {
  float re[kColumns][kGroup], im[kColumns][kGroup];
};

/// A complex number for each mode, by which its state is multiplied.
struct alignas(64) ModeWeight {
  float re[kGroup], im[kGroup];
};

/// The state of each mode at each sample of a sub-block, of what acts in it.
struct alignas(64) SampleStates {
  float re[kSubBlock][kGroup], im[kSubBlock][kGroup];
};

/// A pulse within one sub-block.
struct PulseBlock {
  const std::int16_t* row[kStrikeRows];  // [mode]
  float weight[kStrikeRows];
  int first, last;  // samples first <= n < last feel the pulse
  float moment[kSubBlock][kTerms];
};

/// One end of what a contact does in a sub-block: where and how it pushes at its first sample or at the first one after it.
struct ContactEnd {
  const std::int16_t* row[kStrikeRows];  // [mode]
  float force[kStrikeRows];              // times row and signal: the force on a mode
  float damping[kStrikeRows];            // times row, squared: the damping of a mode by this contact, over a sample
  float give, half_loss;                 // b, the same, makes b give / (angle^2 + b give) the contact spring's share of the energy, and
                                         // angle times half_loss times that the damping by the spring
  float signal[kSubBlock + 1];           // N, at each sample of the sub-block and the first one after it; linear between them
  bool forces;                           // signal is not all zero
};

/// What acts on a body in one sub-block. A contact's force is that of both its ends together; its damping goes from the first to the
/// second.
struct ContactBlock {
  std::array<ContactEnd, 2> push[kMaxContacts];
  int contacts;
  bool forces, damps;     // whether anything has a force, or a damping
  float strength_n_s;     // no more than this impulse reaches the body in the sub-block
  float ramp[2][kTerms];  // moments of 1 - u and of u, times the length of a sample [s]
};

inline constexpr int kTaps = 32;  // samples that an ear reads at once

/// One sample of an ear: the sum of weight[k] source[k], read with taps between those of `taps` and the kTaps behind them.
struct Reading {
  const float* taps;
  float mix;  // 0: the first taps, 1: those behind
  int sources;
  const float* source[4];  // kTaps each
  float weight[4];
};

struct Kernels {
  Isa isa;
  /// Fills the starts of a block, and turns the state to the start of the next.
  void (*advance)(const RotationTable* turn, ModeState* state, ColumnStates* starts, int groups) noexcept;
  /// Adds the sound of `sub_blocks` (1 to kSubBlocks) sub-blocks from `first` on to out, sub-blocks x kSubBlock samples. How a block is cut
  /// into calls does not change a bit.
  void (*emit)(const SoundTable* sound, const ColumnStates* starts, int groups, int first, int sub_blocks, float* out) noexcept;
  /// advance, and emit of the whole block, to the same bits; the starts are kept nowhere.
  void (*ring)(const SoundTable* sound, const RotationTable* turn, ModeState* state, int groups, float* out) noexcept;
  /// Adds what a pulse makes in one sub-block to out, kSubBlock samples, and what it leaves to the starts and the state after it.
  void (*strike)(const StrikeTable* strike, const RotationTable* turn, const PulseBlock& touch, int sub_block, ModeState* state,
                 ColumnStates* starts, int groups, float* out) noexcept;
  /// Adds what a drive makes in one sub-block to out, kSubBlock samples, and what it leaves to the starts and the state after it. When it
  /// damps, that is all the sound of the sub-block (no emit), and every mode's amplitude is multiplied by a factor of at most 1 at each
  /// sample: 1 - e, where e = p / (1 + p), p = x + x^2 / 2 + x^3 / 6, which is 1 - exp(-x) to x^4 / 24, for x the sum over the contacts of
  /// their dampings, kept below the mode's angle; e is linear between both ends.
  void (*drive)(const StrikeTable* strike, const RotationTable* turn, const ContactBlock& drive, int sub_block, ModeState* state,
                ColumnStates* starts, int groups, float* out) noexcept;
  /// emit() of the starts times a weight each.
  void (*emit_weighted)(const SoundTable* sound, const ColumnStates* starts, const ModeWeight* weight, int groups, int first,
                        int sub_blocks, float* out) noexcept;
  /// strike() and drive(), to the same bits, which also add to `kept` the states that they sound.
  void (*strike_and_keep)(const StrikeTable* strike, const RotationTable* turn, const PulseBlock& touch, int sub_block, ModeState* state,
                          ColumnStates* starts, int groups, float* out, SampleStates* kept) noexcept;
  void (*drive_and_keep)(const StrikeTable* strike, const RotationTable* turn, const ContactBlock& drive, int sub_block, ModeState* state,
                         ColumnStates* starts, int groups, float* out, SampleStates* kept) noexcept;
  /// Adds the sum over the modes of the real parts of weight times kept state to out, kSubBlock samples.
  void (*weigh)(const ModeWeight* weight, const SampleStates* kept, int groups, float* out) noexcept;
  /// A sub-block of what an ear hears through taps that stay: kTaps + kSubBlock - 1 samples to kSubBlock.
  void (*convolve)(const float* taps, const float* samples, float* out) noexcept;
  /// And through taps that move.
  void (*read)(const Reading* readings, int count, float* out) noexcept;
};

/// Best that this processor has. Any thread.
Isa find_best_isa() noexcept;
/// Kernels of one instruction set; of the best one below it when the processor does not have it. Any thread.
const Kernels& get_kernels(Isa isa) noexcept;
/// "plain", "simd128", "sse2", "avx2", "avx512".
const char* get_name(Isa isa) noexcept;

// One a source file; call get_kernels().
extern const Kernels kPlainKernels;
#if defined(__x86_64__)
extern const Kernels kSse2Kernels, kAvx2Kernels, kAvx512Kernels;
#elif defined(__wasm_simd128__)
extern const Kernels kSimd128Kernels;
#endif

}  // namespace carillon::synth
