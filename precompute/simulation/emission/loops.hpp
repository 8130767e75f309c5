// Inner loops of emission, compiled once per instruction set. Internal to carillon::emission.
#pragma once

#include <cstddef>
#include <cstdint>

namespace carillon::emission {

inline constexpr int kEntry = 4;                   // support of a step, in half-samples
inline constexpr int kMotionHalf = 24;             // half-samples on either side in the filter for position and velocity
inline constexpr int kDerivativeHalf = 16;         // samples on either side in a derivative
inline constexpr int kPoleSpan = 32;               // samples in a pole
inline constexpr int kSplinePoints = 8;            // support of an arrival, in half-samples
inline constexpr int kSlots = 24;                  // samples affected by one value of OCE01's low-pass
inline constexpr std::size_t kLane = 32;           // row counts are multiples: no remainder loops, which could round differently
inline constexpr std::size_t kVertices = 10;       // rows of kLane, the last two unused
inline constexpr std::size_t kValuesPerCall = 16;  // values per call of OCE01's low-pass: its open samples exceed the L1 cache
inline constexpr int kBatch = 8;                   // samples per call with common frames, for the same reason

/// A double in units of 2^-46 Pa, from the bits of its sum with 1.5 * 2^52: range 2^51 units. Integer sums are order-independent.
inline constexpr double kUnitsPerPa = 70368744177664.0;

/// kLane triangles at one time.
struct Facets {
  double centre[3][kLane], normal[3][kLane];  // m; unit vectors, zero for degenerate triangles
  double twice_area[kLane];                   // m2
};

/// Receiver data of radiate().
struct Ear {
  double place_m[3], axis[3], directivity;
};

/// Frames of rows in blocks of kLane: block b of frame k begins at data + b * stride + (offset of k), in doubles.
struct Frames {
  double* data;
  std::size_t stride;
};

/// Results of a row do not depend on its index, bit for bit.
struct RowLoops {
  /// sum (n, 4) += the four components of u at node[i]; the first time = them.
  void (*add_places)(double* sum, const double* u, const std::int32_t* node, std::size_t n, bool is_first);
  /// open (n, kEntry, 4) += weight[s] times the four components of sum at i and of u at node[i]; either may be null.
  void (*add_value)(double* open, const double* sum, const double* u, const std::int32_t* node, std::size_t n, const double* weight);
  /// Moves three of the four components of open[i][slot], times scale, to frames of kVertices per block; clears open[i][slot].
  void (*close_value)(double* open, std::size_t n, int slot, double scale, Frames to);
  /// Positions and velocities (kBatch frames of rows) from half-samples. offset: 2 (kBatch - 1) + 2 kMotionHalf + 1 frames; sample b uses 2
  /// kMotionHalf + 1 from 2 b on. even[0] weights the centre, even[j] x_j + x_-j, odd[j] x_j - x_-j.
  void (*calc_motion)(Frames from, const std::size_t* offset, std::size_t rows, const double* even, const double* odd, const double* rest,
                      double* const* x, double* const* v);
  /// flux (kLane per block) = scale * (sum of corner velocities) . (cross product of two sides). corner: rows.
  void (*calc_flux)(const double* x, const double* v, const std::int32_t* corner, std::size_t blocks, double scale, Frames flux);
  /// Derivatives of kBatch frames; offset: 2 kDerivativeHalf + kBatch frames. odd[j]: weights of x_j - x_-j.
  void (*calc_rates)(Frames from, const std::size_t* offset, std::size_t blocks, const double* odd, Frames to,
                     const std::size_t* to_offset);
  /// out[b] (rows) = keep * previous (`before` for b = 0) + weighted sum of kPoleSpan frames from b on, for kBatch samples.
  void (*sum_frames)(Frames from, const std::size_t* offset, std::size_t blocks, const double* weight, double keep, const double* before,
                     double* const* out);
  void (*find_facets)(const double* x, const std::int32_t* corner, Facets* facets);
  /// For kLane triangles: travel time per_speed * r, and pressure [Pa] (plain + turned cos) / r times the ear's directivity.
  void (*radiate)(const Facets* facets, const Ear* ear, double per_speed, const double* plain, const double* turned, double* time,
                  double* pa);
  /// Spreads n pressures, at now + time half-samples, over kSplinePoints half-samples of `units` in integer units. Drops samples at or
  /// after `end`, and pressures that are not finite or over 1e4 Pa (returns false). spline: polynomial coefficients (kSplinePoints) of the
  /// points (kSplinePoints).
  bool (*scatter)(std::int64_t* units, double now, double end, const double* time, const double* pa, std::size_t n, const double* spline);
  /// open (rows, kSlots) += sum over i of value (count, rows) x weight[i] (kSlots), i in ascending order.
  void (*add_rows)(double* open, const double* value, std::size_t rows, const double* const* weight, std::size_t count);
};

const RowLoops& find_loops();

}  // namespace carillon::emission
