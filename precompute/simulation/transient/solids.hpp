// Forces, energies and masses of solids in full-order motion: linear and quadratic tetrahedra of one rank.
//
//   Solids solids(elements, laws, places_m, no_entry);          // elements in ascending order
//   solids.add_forces(weights, u, v, f);
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "precompute/simulation/transient/element.hpp"
#include "precompute/simulation/transient/kernel.hpp"
#include "precompute/simulation/transient/quad.hpp"

namespace carillon::transient {

/// 64-byte aligned memory of doubles.
class AlignedDoubles {
 public:
  void resize(std::size_t count);  // zero-initialised
  double* data() { return reinterpret_cast<double*>(lines_.data()); }
  const double* data() const { return reinterpret_cast<const double*>(lines_.data()); }
  std::size_t size() const { return count_; }

 private:
  struct alignas(64) Line {
    double value[8];
  };
  std::vector<Line> lines_;
  std::size_t count_ = 0;
};

/// An element: indices of its nodes in u and v, and in f, which may differ (Domain, "slots").
struct SolidElement {
  Kind kind = Kind::kT4;
  std::int32_t law = 0;                  // index of the law
  std::array<std::int32_t, 10> read{};   // (4 or 10)
  std::array<std::int32_t, 10> write{};  // (4 or 10)
};

/// Elements of one rank in blocks of lanes, in the given order, which is the order of force summation. Forces of an element do not depend
/// on its block: equal elements give equal bits.
class Solids {
 public:
  Solids() = default;
  /// places_m: rest positions by entry of `read`; no_entry: an unread entry of f. Pre: make_shape() succeeds for every element.
  Solids(const std::vector<SolidElement>& elements, const std::vector<Law>& laws, const std::vector<Vec3>& places_m, std::int32_t no_entry,
         const Loops& loops = find_loops());

  std::int64_t element_count() const { return static_cast<std::int64_t>(block_lane_.size()); }

  /// f += elastic and viscous forces [N] of all elements, in order. u [m], v [m/s]: by entries. Keeps the viscous stress for the next call
  /// and accumulates damping work: one call per step. Not collective; does not allocate.
  void add_forces(const StepWeights& weights, const Quad* u, const Quad* v, Quad* f);
  /// Elastic forces only; no other change.
  void add_elastic_forces(const Quad* u, Quad* f) const;

  /// Energy of every element [J], and smallest det F; (element_count).
  void calc_state(const Quad* u, std::vector<double>& energy_j, std::vector<double>& least_det) const;
  /// Damping work per element since the last forget_spent() [J].
  std::vector<double> list_spent() const;
  void forget_spent();

  /// Resumption state: (element_count, 1 + 24), damping work and viscous stress of the previous step.
  static constexpr std::size_t kStateWidth = 1 + 4 * kStresses;
  void save_state(std::vector<double>& state) const;
  void load_state(std::span<const double> state);

 private:
  struct Run {
    Kind kind = Kind::kT4;
    Law law;
    std::int64_t first = 0, count = 0;  // elements
    std::int64_t blocks = 0;
    AlignedDoubles shape, lag, spent;
    std::vector<std::int32_t> read, write;
    BlockRun view() const;
  };
  void add_run(const std::vector<SolidElement>& elements, std::size_t first, std::size_t last, const Law& law,
               const std::vector<Vec3>& places_m, std::int32_t no_entry);

  const Loops* loops_ = nullptr;
  std::vector<Run> runs_;
  struct Place {
    std::int32_t run;
    std::int32_t place;  // index in the run
  };
  std::vector<Place> block_lane_;  // (elements)
};

}  // namespace carillon::transient
