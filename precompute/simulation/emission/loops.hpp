// The inner loops of emission, one build for every instruction set. Internal to carillon::emission.
#pragma once

#include <cstddef>
#include <cstdint>

namespace carillon::emission {

inline constexpr int kEntry = 4;            // half-samples over which a step is spread
inline constexpr int kMotionHalf = 24;      // half-samples on either side of a sample that its place and velocity take
inline constexpr int kDerivativeHalf = 16;  // samples on either side that a derivative takes
inline constexpr int kPoleSpan = 32;        // samples that a pole takes
inline constexpr int kSplinePoints = 8;     // half-samples over which an arrival is spread
inline constexpr int kSlots = 24;           // samples that one value of the low-pass of OCE01 adds to
inline constexpr std::size_t kLane = 32;  // counts of rows are multiples of it: no loop has an end of its own, which could round otherwise
inline constexpr std::size_t kVertices = 10;  // of kLane rows, the last two of which are unused
inline constexpr std::size_t kTogether = 16;  // values per call of the low-pass of OCE01: its open samples exceed the L1 cache
inline constexpr int kBatch = 8;              // samples per call from common frames, for the same reason

/// A double in units of 2^-46 Pa, by the bits of its sum with 1.5 * 2^52: 2^51 units to either side. Sums of whole numbers have no order.
inline constexpr double kUnitsPerPa = 70368744177664.0;

/// Of kLane triangles at one time.
struct Facets {
  double centre[3][kLane], normal[3][kLane];  // m; unit vectors, zero of a triangle without area
  double twice_area[kLane];                   // m2
};

/// A receiver as radiate() takes it.
struct Ear {
  double place_m[3], axis[3], directivity;
};

/// Frames of rows in blocks of kLane: block b of frame k begins at data + b * stride + (the offset of k), in doubles.
struct Frames {
  double* data;
  std::size_t stride;
};

/// What a loop does to a row does not depend on its place among the rows, so neither do the bits of the result.
struct RowLoops {
  /// sum (n, 4) += the four numbers of u at node[i]; the first time = them.
  void (*add_places)(double* sum, const double* u, const std::int32_t* node, std::size_t n, bool is_first);
  /// open (n, kEntry, 4) += weight[s] times the four numbers of sum at i and of u at node[i]; there may be no sum, or no u and node.
  void (*add_value)(double* open, const double* sum, const double* u, const std::int32_t* node, std::size_t n, const double* weight);
  /// Three of the four numbers of open[i][slot], times scale, to frames of kVertices a block; open[i][slot] is 0 afterwards.
  void (*close_value)(double* open, std::size_t n, int slot, double scale, Frames to);
  /// Places and velocities (kBatch frames of rows) from half-samples. offset: 2 (kBatch - 1) + 2 kMotionHalf + 1 frames, of which sample b
  /// takes 2 kMotionHalf + 1 from 2 b on. even[0] is the weight of the middle, even[j] of x_j + x_-j, odd[j] of x_j - x_-j.
  void (*calc_motion)(Frames from, const std::size_t* offset, std::size_t rows, const double* even, const double* odd, const double* rest,
                      double* const* x, double* const* v);
  /// flux (kLane a block) = scale times the sum of the velocities of the corners times the cross product of two sides. corner: rows.
  void (*calc_flux)(const double* x, const double* v, const std::int32_t* corner, std::size_t blocks, double scale, Frames flux);
  /// Derivatives of kBatch frames; offset: 2 kDerivativeHalf + kBatch frames. odd[j]: weights of x_j - x_-j.
  void (*calc_rates)(Frames from, const std::size_t* offset, std::size_t blocks, const double* odd, Frames to,
                     const std::size_t* to_offset);
  /// out[b] (rows) = keep * the one before, for b = 0 `before`, + the sum of kPoleSpan frames from b on times their weights. kBatch of
  /// them.
  void (*sum_frames)(Frames from, const std::size_t* offset, std::size_t blocks, const double* weight, double keep, const double* before,
                     double* const* out);
  void (*find_facets)(const double* x, const std::int32_t* corner, Facets* facets);
  /// Of kLane triangles: the time of the way, per_speed r, and the pressure [Pa], (plain + turned cos) / r times the directivity of the
  /// ear.
  void (*radiate)(const Facets* facets, const Ear* ear, double per_speed, const double* plain, const double* turned, double* time,
                  double* pa);
  /// Each of n pressures, at now + time half-samples, is spread over kSplinePoints half-samples, from units[half-sample] on, in whole
  /// units. Samples at or behind `end` are dropped, as are pressures that are not finite or over 1e4 Pa: then false. spline: factors of
  /// powers (kSplinePoints) of the points (kSplinePoints).
  bool (*scatter)(std::int64_t* units, double now, double end, const double* time, const double* pa, std::size_t n, const double* spline);
  /// open (rows, kSlots) += the sum over i of value (count, rows) x weight[i] (kSlots), one i after the other.
  void (*add_rows)(double* open, const double* value, std::size_t rows, const double* const* weight, std::size_t count);
};

extern const RowLoops kLoopsPlain, kLoopsAvx2, kLoopsAvx512;
const RowLoops& find_loops();

}  // namespace carillon::emission
