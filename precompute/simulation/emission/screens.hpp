// delta: rays from triangles to receivers past surfaces, balls and walls. Internal to carillon::emission.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "precompute/simulation/emission/emission.hpp"
#include "precompute/simulation/emission/rows.hpp"
#include "precompute/simulation/emission/surfaces.hpp"

namespace carillon::emission {

/// Occlusion by silent surfaces, moving balls, walls and the sounding surfaces. Invariant: delta is the same on any number of ranks.
class Screens {
 public:
  /// Collective. options: as for Emission.
  Screens(const Surfaces& surfaces, const SurfacePart& part, const Options& options);

  /// Current positions [m].
  void set_balls(std::span<const Vec3> centres_m) { balls_.assign(centres_m.begin(), centres_m.end()); }
  /// Stores the positions of sample k, which begins with these displacements.
  void keep(std::int64_t k, const double* u);
  /// Casts the rays at sample k, x its positions, every 1/1000 s; no work at other samples. Collective.
  void look(std::int64_t k, const double* x);
  /// delta of a receiver at sample k, after look(k): `count` slots from the first on.
  void shade(std::int64_t k, std::size_t receiver, std::size_t first, std::size_t count, double* pa) const;

  template <typename Visit>
  void visit_state(Visit&& visit) {
    visit(places_, before_, now_);
  }

 private:
  double* get_places(std::int64_t k) { return places_.data() + static_cast<std::size_t>(k) / every_ % ring_ * rows_; }

  const Surfaces& surfaces_;
  const Options& options_;
  std::vector<std::int32_t> node_;                      // caller's nodes, on this rank
  std::vector<double> rest_;                            // m
  std::vector<std::array<std::int64_t, 3>> triangles_;  // of all ranks, into the nodes of all ranks, concatenated by rank
  std::size_t every_, rows_, ring_;                     // samples between two visibility tests; numbers per row of places_; rows kept
  std::vector<Vec3> balls_;
  std::vector<double> places_;       // (ring_, rows_): nodes, then balls [m]
  std::vector<float> before_, now_;  // (receivers, slots) at the last two tests
};

}  // namespace carillon::emission
