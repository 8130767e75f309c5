// Thin sheets: forces of mid-edge (Morley) bending and constant-strain membranes.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "precompute/simulation/transient/kernel.hpp"
#include "precompute/simulation/transient/quad.hpp"
#include "precompute/simulation/transient/sheet_mesh.hpp"

namespace carillon::transient {

/// Sheet properties: Saint Venant-Kirchhoff in plane stress, stiffness-proportional strain-rate damping.
struct SheetLaw {
  double lambda_pa = 0, mu_pa = 0, density_kg_m3 = 0;
  double thickness_m = 0;
  double alpha1_s = 0;  // viscous stress per strain rate over elastic stress per strain
};

/// Inertia of an edge angle: share of the triangle's third mass, over twice the area: beta of docs/equations.md E11.
inline constexpr double kEdgeInertia = 0.02;

/// Lumped masses of a sheet's nodes: [kg] of vertices, [kg m^2] of edges; a ghost gets that of its triangle's third, and is fixed.
std::vector<double> calc_masses(const SheetElements& elements, const SheetLaw& law);

/// Triangles in blocks, structure of arrays. Arbitrary node numbering: `read` locates a node's state, `write` its force. A node's force is
/// the sum over its triangles in ascending order, independent of the blocks.
class Sheets {
 public:
  /// rest_m: (n) by `read` numbers. read, write: (triangles, 9) as SheetElements::nodes; -1 for none. which: triangles of `elements` to
  /// use, ascending. spare: unread force entry.
  Sheets(const SheetElements& elements, std::span<const std::int32_t> which, const SheetLaw& law,
         std::span<const std::array<std::int32_t, 9>> read, std::span<const std::array<std::int32_t, 9>> write, std::int32_t spare);

  std::size_t count() const { return count_; }
  /// Adds forces [N] on vertices and moments [N m] on edge angles. x: positions [m] and, for edges, angles [rad] in .x; v: velocities.
  /// Accumulates the damping work.
  void add_forces(const StepWeights& weights, const Quad* x, const Quad* v, Quad* f);
  /// Elastic forces only; no other change.
  void add_elastic_forces(const Quad* x, Quad* f) const;

  /// [J] of triangle k (as indexed by `which`) at positions x.
  double calc_energy(std::size_t k, const Quad* x) const;
  /// [J] damping work of triangle k since the last forget_spent().
  double get_spent(std::size_t k) const { return spent_[k]; }
  void forget_spent() { std::fill(spent_.begin(), spent_.end(), 0.0); }
  /// Resumption state of triangle k: damping work and viscous stresses of the previous step.
  static constexpr std::size_t kStateWidth = 1 + 6;
  void save_state(std::size_t k, double* state) const;
  void load_state(std::size_t k, const double* state);

  static constexpr std::size_t kLanes = 4;
  static constexpr std::size_t kConstants = 18;

  /// Constants of a lane: membrane frame 1/p, -q/(p r), 1/r; A t lambda', 2 A t mu; B00 B11 B22 B01 B02 B12; turn (3); side (3); alpha1;
  /// rest strains s0 (3) separate.
  struct alignas(32) Block {
    double constant[kConstants][kLanes];
    double rest[3][kLanes];
    std::int32_t read[9][kLanes];
    std::int32_t write[9][kLanes];
  };

 private:
  std::size_t count_ = 0;
  bool is_damped_ = false;
  std::vector<Block> blocks_;
  std::vector<double> lag_;    // (blocks, 6, lanes) viscous stress resultants of the previous step [N m], in strain and angle
  std::vector<double> spent_;  // (blocks, lanes) [J]
};

/// Loop over blocks. lag: (count, 6, kLanes), spent: (count, kLanes).
void add_sheet_forces(const Sheets::Block* blocks, std::size_t count, bool is_damped, const StepWeights& weights, const Quad* x,
                      const Quad* v, Quad* f, double* lag, double* spent);

}  // namespace carillon::transient
