// The inner loops of Transfers, once for each instruction set. Each source file of an instruction set is compiled with flags of its own, so
// nothing here may be an inline function.
#pragma once

#include <cstddef>
#include <cstdint>

namespace carillon::radiation {

inline constexpr int kTransferLanes = 16;  // modes that are evaluated together

/// One multipole of every mode of a group, in steps: the imaginary part in the upper half of a number, the real part in the lower one.
struct alignas(64) MultipoleLine {
  std::int32_t steps[kTransferLanes];
};

/// One order l of every mode of a group.
struct alignas(64) RadialLine {
  float step_re[kTransferLanes], step_im[kTransferLanes];  // h_{l-1}(k R) / h_l(k R); i for l = 0
  float level[kTransferLanes];                             // sqrt(sum over m of |a_lm|^2 / 4 pi), in steps
};

/// Modes that are evaluated together. Lanes that hold none have multipoles and scales of zero.
struct alignas(64) TransferGroup {
  float inverse_k_m[kTransferLanes];
  float scale[kTransferLanes];  // Pa s m^-1 kg^-1/2 per 1 / 65536 of a step
  std::size_t first_line;       // of (order + 1)^2 lines: l by l, m = 0, then the cosines m = 1 .. l, then the sines
  std::size_t first_radial;     // of order + 1
  int order;                    // the highest of its modes
};

/// A direction, and the factors of the recurrence of the normalised associated Legendre functions: row l of `ahead` and `behind` begins at
/// l (l - 1) / 2 and has m = 0 .. l - 1; P_lm = ahead cos P_(l-1)m - behind P_(l-2)m, P_ll = diagonal[l] sin P_(l-1)(l-1).
struct HarmonicWork {
  const double* ahead;
  const double* behind;
  const double* diagonal;
  double cosine, sine;            // of the angle to the z axis
  double turn_cosine, turn_sine;  // of the angle about it
  int order;
};

/// The real orthonormal harmonics of all orders to work.order, (order + 1)^2 in the sequence of TransferGroup. What is below 1e-20 is 0.
using CalcHarmonics = void (*)(const HarmonicWork& work, float* harmonics);

/// A group at a distance. `radial` has room for (order + 1, 3, kTransferLanes).
struct TransferWork {
  const TransferGroup* group;
  const MultipoleLine* lines;  // of the group
  const RadialLine* steps;     // of the group
  const float* harmonics;      // to the order of the group
  float nearness, inverse_r;   // R / r, 1 / r [1/m]
  float* radial;
};

/// T of every mode of the group, (kTransferLanes) each.
using CalcTransfers = void (*)(const TransferWork& work, float* re, float* im);

void calc_harmonics_plain(const HarmonicWork& work, float* harmonics);
void calc_harmonics_avx2(const HarmonicWork& work, float* harmonics);
void calc_harmonics_avx512(const HarmonicWork& work, float* harmonics);
void calc_transfers_plain(const TransferWork& work, float* re, float* im);
void calc_transfers_avx2(const TransferWork& work, float* re, float* im);
void calc_transfers_avx512(const TransferWork& work, float* re, float* im);

}  // namespace carillon::radiation
