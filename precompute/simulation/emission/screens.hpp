// delta: the rays from triangles to receivers past surfaces, balls and walls. Internal to carillon::emission.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "precompute/simulation/emission/emission.hpp"
#include "precompute/simulation/emission/rows.hpp"
#include "precompute/simulation/emission/surfaces.hpp"

namespace carillon::emission {

/// Silent surfaces, moving balls and walls, with the surfaces that sound. Invariant: delta is the same on any number of ranks.
class Screens {
 public:
  /// Collective. options: as of Emission.
  Screens(const Surfaces& surfaces, const SurfacePart& part, const Options& options);

  /// Now [m].
  void set_balls(std::span<const Vec3> centres_m) { balls_.assign(centres_m.begin(), centres_m.end()); }
  /// Places of sample k, which begins with these displacements.
  void keep(std::int64_t k, const double* u);
  /// Rays at sample k, x its places, every 1/1000 s; no work at the other samples. Collective.
  void look(std::int64_t k, const double* x);
  /// delta of a receiver at sample k, behind look(k): of `count` slots from the first on.
  void shade(std::int64_t k, std::size_t receiver, std::size_t first, std::size_t count, double* pa) const;

  template <typename Visit>
  void visit_state(Visit&& visit) {
    visit(places_, before_, now_);
  }

 private:
  double* get_places(std::int64_t k) { return places_.data() + static_cast<std::size_t>(k) / every_ % ring_ * rows_; }

  const Surfaces& surfaces_;
  const Options& options_;
  std::vector<std::int32_t> node_;                      // of the caller, on this rank
  std::vector<double> rest_;                            // m
  std::vector<std::array<std::int64_t, 3>> triangles_;  // of all ranks, into the nodes of all ranks, one rank behind another
  std::size_t every_, rows_, ring_;                     // samples between two looks; numbers of a row of places_; rows that are kept
  std::vector<Vec3> balls_;
  std::vector<double> places_;       // (ring_, rows_): nodes, then balls [m]
  std::vector<float> before_, now_;  // (receivers, slots) at the last two looks
};

}  // namespace carillon::emission
