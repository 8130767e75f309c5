// Pressures of triangles as printed in OCE01, and its low-pass from steps to samples. Internal to carillon::emission.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

#include "precompute/simulation/emission/loops.hpp"
#include "precompute/simulation/emission/rows.hpp"
#include "precompute/simulation/emission/surfaces.hpp"

namespace carillon::emission {

/// Filters many signals (rows) by OCE01 eq. 6 and 7: a sinc with fmax = half the sample rate under a Hann window of kHalfWidth samples per
/// side, w = ceil(3 / (fmax h)) steps. Invariant: every sample is normalised by the sum of its weights. Rows: a multiple of kLane.
class LowPass {
 public:
  static constexpr int kHalf = kSlots / 2;  // samples on either side
  static constexpr double kHalfWidth = 6.0;

  /// An interval between two samples has `values` values; the first is offset by `first` value spacings from its beginning.
  LowPass(std::size_t rows, int values, double first);

  /// Value i of this interval: (rows).
  void add(int i, const double* value);
  /// Ends interval n: out (rows) becomes sample n + 1 - kHalf.
  void close(double* out);

  template <typename Visit>
  void visit_state(Visit&& visit) {
    take_in();  // same order of summation
    visit(ring_, weights_, open_);
  }

 private:
  void take_in();

  std::size_t rows_;
  const RowLoops* loops_ = &find_loops();
  int ring_ = 0;                                        // slot of the oldest open sample
  std::vector<std::array<double, 2 * kSlots>> weight_;  // (values), twice, for any ring offset
  std::array<double, kSlots> weights_{};                // sum of weights of each open sample
  std::vector<double> open_;                            // (rows, kSlots)
  std::vector<double> waiting_;                         // (kValuesPerCall, rows): values not yet in open_
  std::array<const double*, kValuesPerCall> waiting_weight_{};
  std::size_t waiting_count_ = 0;
};

/// Eq. 5 at every step, between two steps, where the velocity is defined; pressures and positions are filtered alike.
class PaperFilter {
 public:
  /// take(k): receives sample k, from 1 - LowPass::kHalf on. rho_c: impedance of the air [Pa s/m].
  PaperFilter(const Surfaces& surfaces, double sample_rate_hz, int steps_per_sample, double rho_c, std::function<void(std::int64_t)> take);

  /// u: (N, 4) displacements of the caller's nodes [m].
  void add_step(const double* u);
  /// Holds all vertices at rest until is_done().
  void finish(const std::function<bool()>& is_done);

  const double* get_places() const { return places_.get(); }  // (rows) m
  double* get_pressures() { return sources_.get(); }          // (slots) Pa

  template <typename Visit>
  void visit_state(Visit&& visit) {
    visit(step_, interval_, has_last_, last_.get_blocks());
    places_filter_.visit_state(visit);
    pressure_filter_.visit_state(visit);
  }

 private:
  void advance();

  const Surfaces& surfaces_;
  int steps_;
  double scale_;
  std::function<void(std::int64_t)> take_;
  LowPass places_filter_, pressure_filter_;
  std::int64_t step_ = 0, interval_ = 0;  // of the interval; samples around it
  bool has_last_ = false;
  Rows now_, last_;  // (rows) displacements of this and the previous step [m]
  Rows pressure_;    // (slots) of this step
  Rows places_, sources_;
};

}  // namespace carillon::emission
