// Initial shapes of bent bodies: equilibrium under forces, or one mode.
#pragma once

#include <cstdint>
#include <vector>

#include "precompute/simulation/transient/domain.hpp"

namespace carillon::transient {

/// A node (assembly number) with a prescribed displacement.
struct HeldNode {
  std::int32_t node = 0;
  Vec3 displacement_m{};
};
/// A node with a force [N] of constant direction.
struct PulledNode {
  std::int32_t node = 0;
  Vec3 force_n{};
};

/// (nodes) Displacements from rest in equilibrium under `pulled`, with `held` prescribed; for a sheet edge the angle, in x. `held` must
/// include nodes with clamped direction. Large displacements, all bodies of `domain` (one rank). Throws InputError without an equilibrium:
/// an unconstrained body, or a force too strong for the mesh. Not collective.
std::vector<Quad> calc_equilibrium(Domain& domain, const std::vector<HeldNode>& held, const std::vector<PulledNode>& pulled);

struct ElasticMode {
  double omega_rad_s = 0.0;
  std::vector<Quad> shape;  // (nodes) largest displacement 1, its largest component positive
};
inline constexpr int kMostModes = 20;

/// Elastic mode of this number, 1 (lowest) to kMostModes, about rest. held: fixed nodes; their displacements are ignored. One rank. Throws
/// InputError for a body with fewer modes. Not collective.
ElasticMode calc_mode(Domain& domain, const std::vector<HeldNode>& held, int number);

}  // namespace carillon::transient
