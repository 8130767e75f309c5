// The inner loops of emission, one build for every instruction set. Internal to carillon::emission.
#pragma once

#include <cstddef>
#include <cstdint>

namespace carillon::emission {

inline constexpr int kSlots = 24;           // samples that one value of a low-pass adds to
inline constexpr int kDerivativeHalf = 16;  // samples on either side that a derivative takes
inline constexpr int kSpread = 32;          // samples over which an arrival is spread
inline constexpr std::size_t kLane = 32;  // counts of rows are multiples of it: no loop has an end of its own, which could round otherwise
inline constexpr std::size_t kTogether = 16;  // values per call of a low-pass: its open samples exceed the L1 cache
inline constexpr int kBatch = 8;              // samples per call from common frames, for the same reason

/// A double in units of 2^-46 Pa, by the bits of its sum with 1.5 * 2^52: 2^51 units to either side. Sums of whole numbers have no order.
inline constexpr double kUnitsPerPa = 70368744177664.0;
inline constexpr double kLargestPa = 30.0;  // that scatter() may be given

/// What a loop does to a row does not depend on its place among the rows, so neither do the bits of the result.
struct RowLoops {
  /// sum (n, 4) += the four numbers of u at node[i].
  void (*add_places)(double* sum, const double* u, const std::int32_t* node, std::size_t n);
  /// open (rows, kSlots) += the sum over i of value (count, rows) x weight[i] (kSlots), one i after the other.
  void (*add_rows)(double* open, const double* value, std::size_t rows, const double* const* weight, std::size_t count);
  /// v, a (kBatch, rows). frame: 2 kDerivativeHalf + kBatch samples of x (rows), of which sample b takes 2 kDerivativeHalf + 1 from b on.
  /// first: odd, weights of x_j - x_-j; second: even, of x_j + x_-j; [0] of x_0.
  void (*calc_derivatives)(const double* const* frame, std::size_t rows, const double* first, const double* second, double* v, double* a);
  /// out[b] (rows) = keep * the one before, for b = 0 `before`, + the sum of kSpread frames from b on times their weights. kBatch of them.
  void (*sum_frames)(const double* const* frame, std::size_t rows, const double* weight, double keep, const double* before,
                     double* const* out);
  /// to (kSpread) += pa times the sum of share[i] row (3, kSpread), in whole units; |pa| <= kLargestPa.
  void (*scatter)(std::int64_t* to, double pa, const float* row, const float* share);
};

extern const RowLoops kLoopsPlain, kLoopsAvx2, kLoopsAvx512;
const RowLoops& find_loops();

}  // namespace carillon::emission
