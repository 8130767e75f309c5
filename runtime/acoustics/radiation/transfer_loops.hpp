// Inner loops of Transfers, selected by instruction set at run time.
#pragma once

#include <cstddef>
#include <cstdint>

#include "runtime/base/instructions.hpp"

namespace carillon::radiation {

inline constexpr int kTransferLanes = 16;  // modes evaluated together
inline constexpr int kTransferPlaces = 2;  // places evaluated together; more exceed the registers

/// One multipole of every mode of a group, in steps: 65536 times the imaginary part plus the real part.
struct alignas(64) MultipoleLine {
  std::int32_t steps[kTransferLanes];
};

/// One order l of every mode of a group.
struct alignas(64) RadialLine {
  float step_re[kTransferLanes], step_im[kTransferLanes];  // h_{l-1}(k R) / h_l(k R); i for l = 0
  float level[kTransferLanes];                             // sqrt(sum over m of |a_lm|^2 / 4 pi), in steps
};

/// Modes evaluated together. Empty lanes have zero multipoles and scales.
struct alignas(64) TransferGroup {
  float inverse_k_m[kTransferLanes];
  float scale[kTransferLanes];  // Pa s m^-1 kg^-1/2 per 1 / 65536 of a step
  std::size_t first_line;       // of (order + 1)^2 lines: l by l, m = 0, then cosines m = 1 .. l, then sines
  std::size_t first_radial;     // of order + 1
  int order;                    // highest order of its modes
};

inline constexpr int kHarmonicsPadding = 8;  // numbers read beyond the end by vector loads

/// A direction, and recurrence factors of the normalised associated Legendre functions: row l of `ahead` and `behind` begins at l (l - 1) /
/// 2 and has m = 0 .. l - 1; P_lm = ahead cos P_(l-1)m - behind P_(l-2)m, P_ll = diagonal[l] sin P_(l-1)(l-1). Both are finite for
/// kHarmonicsPadding further numbers.
struct HarmonicWork {
  const double* ahead;
  const double* behind;
  const double* diagonal;
  double cosine, sine;            // of the polar angle
  double turn_cosine, turn_sine;  // of the azimuth
  int order;
};

/// A place. `radial`: buffer (order + 1, 3, kTransferLanes); `re`, `im`: T of every mode of the group.
struct TransferPlace {
  const float* harmonics;     // up to the order of the group
  float nearness, inverse_r;  // R / r, 1 / r [1/m]
  float* radial;
  float *re, *im;
};

/// A group at one or two places.
struct TransferWork {
  const TransferGroup* group;
  const MultipoleLine* lines;  // of the group
  const RadialLine* steps;     // of the group
  TransferPlace places[kTransferPlaces];
  int count;  // of places
};

struct TransferLoops {
  /// Real orthonormal harmonics up to work.order, (order + 1)^2 in the sequence of TransferGroup, with space for kHarmonicsPadding more.
  /// Values below 1e-20 are 0.
  void (*calc_harmonics)(const HarmonicWork& work, float* harmonics);
  /// T of every mode of the group at each place.
  void (*calc_transfers)(const TransferWork& work);
};

/// Loops of the best supported instruction set up to `best`.
const TransferLoops& find_transfer_loops(base::Instructions best);

}  // namespace carillon::radiation
