// Pressures of triangles as printed in OCE01. Internal to carillon::emission.
#pragma once

#include <cstdint>
#include <functional>

#include "precompute/simulation/emission/low_pass.hpp"
#include "precompute/simulation/emission/rows.hpp"
#include "precompute/simulation/emission/surfaces.hpp"

namespace carillon::emission {

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
