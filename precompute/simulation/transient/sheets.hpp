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

/// What a sheet is made of: Saint Venant-Kirchhoff in plane stress, loss by strain rate in proportion to the stiffness.
struct SheetLaw {
  double lambda_pa = 0, mu_pa = 0, density_kg_m3 = 0;
  double thickness_m = 0;
  double alpha1_s = 0;  // stress of a strain rate over that of the strain
};

/// Share of the mass of a triangle's third that the angle of an edge has, over twice the area: beta of docs/equations.md E11.
inline constexpr double kEdgeInertia = 0.02;

/// The lumped masses of a sheet's nodes: [kg] of vertices, [kg m^2] of edges; a ghost gets that of its triangle's third, and is fixed.
std::vector<double> calc_masses(const SheetElements& elements, const SheetLaw& law);

/// Triangles in blocks, structure of arrays. Nodes may be numbered in any way: `read` says where a node's state is, `write` where its force
/// is added to. The force on a node is the sum over its triangles in ascending order; it does not depend on how they are cut into blocks.
class Sheets {
 public:
  /// rest_m: (n) by `read` numbers. read, write: (triangles, 9) as SheetElements::nodes; -1 where there is none.
  /// which: the triangles of `elements` to take, ascending. spare: an unread place in the array of forces.
  Sheets(const SheetElements& elements, std::span<const std::int32_t> which, const SheetLaw& law,
         std::span<const std::array<std::int32_t, 9>> read, std::span<const std::array<std::int32_t, 9>> write, std::int32_t spare);

  std::size_t count() const { return count_; }
  /// Adds the forces [N] on vertices and the moments [N m] on edge angles. x: (places) positions [m] and, of edges, angles [rad] in .x;
  /// v: (places) velocities. Adds up the work against damping.
  void add_forces(const StepWeights& weights, const Quad* x, const Quad* v, Quad* f);
  /// Only the elastic ones; changes nothing else.
  void add_elastic_forces(const Quad* x, Quad* f) const;

  /// [J] of triangle k (as `which` counts) at positions x.
  double calc_energy(std::size_t k, const Quad* x) const;
  /// [J] that damping has taken from triangle k since the last forget_spent().
  double get_spent(std::size_t k) const { return spent_[k]; }
  void forget_spent() { std::fill(spent_.begin(), spent_.end(), 0.0); }
  /// What must be kept of triangle k to resume: the work against damping and the viscous stresses of the step before.
  static constexpr std::size_t kStateWidth = 1 + 6;
  void save_state(std::size_t k, double* state) const;
  void load_state(std::size_t k, const double* state);

  static constexpr std::size_t kLanes = 4;
  static constexpr std::size_t kConstants = 18;

  /// Constants of a lane: membrane frame 1/p, -q/(p r), 1/r; A t lambda', 2 A t mu; B00 B11 B22 B01 B02 B12; turn (3); side (3); alpha1;
  /// and the rest strains s0 (3) apart.
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
  std::vector<double> lag_;    // (blocks, 6, lanes) viscous stress resultants of the step before [N m], in strain and angle
  std::vector<double> spent_;  // (blocks, lanes) [J]
};

/// The loop over blocks, once per instruction set. lag: (count, 6, kLanes), spent: (count, kLanes).
using AddSheetForces = void(const Sheets::Block* blocks, std::size_t count, bool is_damped, const StepWeights& weights, const Quad* x,
                            const Quad* v, Quad* f, double* lag, double* spent);
AddSheetForces add_sheet_forces_plain;
#if defined(__x86_64__)
AddSheetForces add_sheet_forces_avx2;
AddSheetForces add_sheet_forces_avx512;
#endif

}  // namespace carillon::transient
