// The inner loops over modes, one implementation for every instruction set, chosen when a voice is made.
//
// Modes come in groups of kGroup; lanes that hold no mode have zero tables. Each source file of an instruction set is compiled with flags
// of its own, so nothing here may be an inline function.
#pragma once

#include <array>
#include <cstdint>

namespace carillon::synth {

inline constexpr int kGroup = 16;        // modes that are stored and culled together
inline constexpr int kQuantum = 32;      // samples of one table: the grid on which anything may change
inline constexpr int kPeriod = 128;      // samples between two steps of the double-precision state
inline constexpr int kQuanta = 4;        // in a period
inline constexpr int kTerms = 10;        // Chebyshev terms of a strike: -169 dB at the Nyquist frequency
inline constexpr int kStrikeRows = 9;    // three corners times three directions
inline constexpr int kMostContacts = 8;  // that drive a body at once

/// Instruction sets, least first. kBest stands for the last one that the processor has.
enum class Isa : std::uint8_t { kPlain, kSse2, kAvx2, kAvx512, kBest };

/// The sound of each mode over a quantum: sample k is re wave[m][0][k] + im wave[m][1][k] when the quantum begins in the state re + i im.
struct alignas(64) SoundTable {
  float wave[kGroup][2][kQuantum];
};

/// How each mode turns while nothing drives it.
struct alignas(64) TurnTable {
  double period_re[kGroup], period_im[kGroup];                           // over kPeriod samples
  float quanta_re[kQuanta - 1][kGroup], quanta_im[kQuanta - 1][kGroup];  // over 1, 2 and 3 quanta
};

/// How each mode answers a strike.
struct alignas(64) StrikeTable {
  float turn_re[kGroup], turn_im[kGroup];                    // over one sample
  float out_re[kGroup], out_im[kGroup];                      // pressure = out_re re + out_im im
  float scale[kGroup];                                       // of the rows of a Touch or a Push
  float angle[kGroup];                                       // omega over one sample [rad]
  float force_re[kTerms][kGroup], force_im[kTerms][kGroup];  // Chebyshev coefficients of the answer within a sample
};

/// The state of each mode at the start of the next period.
struct alignas(64) ModeState {
  double re[kGroup], im[kGroup];
};

/// The state of each mode at the start of each quantum of this period.
struct alignas(64) Starts {
  float re[kQuanta][kGroup], im[kQuanta][kGroup];
};

/// A pulse within one quantum.
struct Touch {
  const std::int16_t* row[kStrikeRows];  // [mode]
  float weight[kStrikeRows];
  int first, last;  // samples first <= n < last feel the pulse
  float moment[kQuantum][kTerms];
};

/// One end of what a contact does in a quantum: where and how it pushes at its first sample or at the first one after it.
struct Push {
  const std::int16_t* row[kStrikeRows];  // [mode]
  float force[kStrikeRows];              // times row and signal: the force on a mode
  float brake[kStrikeRows];              // times row, squared: the damping of a mode by this contact, over a sample
  float give, half_loss;                 // b, the same, makes b give / (angle^2 + b give) the contact spring's share of the energy, and
                                         // angle times half_loss times that the damping by the spring
  float signal[kQuantum + 1];            // N, at each sample of the quantum and the first one after it; linear between them
  bool forces;                           // signal is not all zero
};

/// What acts on a body in one quantum. A contact's force is that of both its ends together; its damping goes from the first to the second.
struct Drive {
  std::array<Push, 2> push[kMostContacts];
  int contacts;
  bool forces, damps;     // whether anything has a force, or a brake
  float strength_n_s;     // no more than this impulse reaches the body in the quantum
  float ramp[2][kTerms];  // moments of 1 - u and of u, times the length of a sample [s]
};

inline constexpr int kGridPoints = 256;  // frequencies of the grid on which the modes of a driven bank meet, 0 to the sample rate
inline constexpr int kReach = 8;         // of them that make up a mode of little damping; of more: twice or three times as many
inline constexpr int kGridMargin = 16;   // of grid points below the first and above the one of the Nyquist frequency
inline constexpr int kGridSize = 128 + 3 * kGridMargin;  // floats of a grid: one point at the Nyquist frequency, the rest for whole vectors
inline constexpr int kRunStep = 2, kPointStep = 2;       // modes of runs and points of windows are multiples: few loops end by surprise
inline constexpr int kTapMargin = 16, kTapLength = kTapMargin + kPeriod;

/// Sixteen numbers, aligned.
struct alignas(64) LaneRow {
  float value[kGroup];
};

/// What the transforms between a period of samples and the grid need.
struct alignas(64) GridTransform {
  float window[kPeriod];                         // by which the sums of grid exponentials are multiplied
  float turn_re[8][16], turn_im[8][16];          // e^{2 pi i j k / 16}
  float twiddle_re[16][16], twiddle_im[16][16];  // e^{2 pi i j k / 256}
  float alternate[16];                           // 1, -1, ...
};

/// How each mode turns over a period while nothing drives it, and what a step of 1 N at the start of a period makes of it.
struct alignas(64) FilterTurn {
  double re[kGroup], im[kGroup];
  float step_re[kGroup], step_im[kGroup];
};

/// The grid points that a group of modes listens to, counted from kGridMargin below zero.
struct GridWindow {
  int first, points;
};

/// Modes that follow each other and add to the same kReach grid points; behind them, up to a multiple of kRunStep, others with zeros for
/// rows. `place`: of the first point in the copy of the grid whose windows begin at the same multiple of kReach, so that those of one copy
/// do not overlap unless they are the same, and no run waits for what the one before it has stored.
struct GridRun {
  int first_mode, modes, place;
};

/// Modes that are in no grid: re + i im is c^t, scale what stands before the sum of input[kPeriod - 1 - t] c^t.
struct alignas(64) DirectTable {
  float re[kGroup][kPeriod], im[kGroup][kPeriod];
  float scale_re[kGroup], scale_im[kGroup];
};

/// The answer of a bank to an impulse, 16 times: tap[s][kTapMargin + n] is that after n - s samples, zero before the impulse.
struct alignas(64) ResponseTable {
  float tap[16][kTapLength];
};

/// A driven bank: `groups` of modes on the grid, then `direct_groups` of others.
struct FilterBank {
  const GridTransform* transform = nullptr;
  int groups = 0, direct_groups = 0, run_count = 0;
  const FilterTurn* turns = nullptr;
  const GridWindow* windows = nullptr;  // of the groups of the grid
  const float* weights = nullptr;       // for each group, [point][re, im][mode]
  const GridRun* runs = nullptr;
  const float* rows = nullptr;  // for each mode of each run, [re, im][kReach]
  const DirectTable* direct = nullptr;
  ModeState* states = nullptr;
  float* start_re = nullptr;  // the states in single precision
  float* start_im = nullptr;
  float* copies = nullptr;  // kReach x 2 x kGridSize zeros
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
  /// Fills the starts of a period, and turns the state to the start of the next.
  void (*advance)(const TurnTable* turn, ModeState* state, Starts* starts, int groups) noexcept;
  /// Adds the sound of `quanta` (1 to kQuanta) quanta from `first` on to out, quanta x kQuantum samples. How a period is cut into calls
  /// does not change a bit.
  void (*emit)(const SoundTable* sound, const Starts* starts, int groups, int first, int quanta, float* out) noexcept;
  /// advance, and emit of the whole period, to the same bits; the starts are kept nowhere.
  void (*ring)(const SoundTable* sound, const TurnTable* turn, ModeState* state, int groups, float* out) noexcept;
  /// Adds what a pulse makes in one quantum to out, kQuantum samples, and what it leaves to the starts and the state after it.
  void (*strike)(const StrikeTable* strike, const TurnTable* turn, const Touch& touch, int quantum, ModeState* state, Starts* starts,
                 int groups, float* out) noexcept;
  /// Adds what a drive makes in one quantum to out, kQuantum samples, and what it leaves to the starts and the state after it. When it
  /// damps, that is all the sound of the quantum (no emit), and every mode's amplitude is multiplied by a factor of at most 1 at each
  /// sample: 1 - e, where e = p / (1 + p), p = x + x^2 / 2 + x^3 / 6, which is 1 - exp(-x) to x^4 / 24, for x the sum over the contacts of
  /// their brakes, kept below the mode's angle; e is linear between both ends.
  void (*drive)(const StrikeTable* strike, const TurnTable* turn, const Drive& drive, int quantum, ModeState* state, Starts* starts,
                int groups, float* out) noexcept;
  /// Takes a period of input, and a step of force at its end, and gives the pressure of the modes in the next one by what drove them until
  /// now.
  void (*filter)(const FilterBank& bank, const float* input, double step, float* ringing) noexcept;
  /// What a period's input makes in quantum `tile` of the same period, from the period's start on. What is behind the quantum does not
  /// matter, what is yet to come within it must be zero.
  void (*respond)(const ResponseTable& response, const float* input, int tile, float* out) noexcept;
  /// A quantum of what an ear hears through taps that stay: kTaps + kQuantum - 1 samples to kQuantum.
  void (*convolve)(const float* taps, const float* samples, float* out) noexcept;
  /// And through taps that move.
  void (*read)(const Reading* readings, int count, float* out) noexcept;
};

/// Best that this processor has. Any thread.
Isa find_best_isa() noexcept;
/// Kernels of one instruction set; of the best one below it when the processor does not have it. Any thread.
const Kernels& get_kernels(Isa isa) noexcept;
/// "plain", "sse2", "avx2", "avx512".
const char* get_name(Isa isa) noexcept;

// One a source file; call get_kernels().
extern const Kernels kPlainKernels;
#if defined(__x86_64__)
extern const Kernels kSse2Kernels, kAvx2Kernels, kAvx512Kernels;
#endif

}  // namespace carillon::synth
