// The shape of a body that is bent before it is let go: in equilibrium under forces, or one of its modes.
#pragma once

#include <cstdint>
#include <vector>

#include "precompute/transient/domain.hpp"

namespace carillon::transient {

/// A node that is held in place, by its number in the assembly.
struct HeldNode {
  std::int32_t node = 0;
  Vec3 displacement_m{};
};
/// A node that a force [N] pulls at, which keeps its direction.
struct PulledNode {
  std::int32_t node = 0;
  Vec3 force_n{};
};

/// (nodes) Displacements from rest at which elastic forces balance what pulls, with `held` nodes where they are held; of an edge of a sheet
/// the angle in x. Nodes whose direction a clamp keeps are held, too. All bodies of `domain`, which has one rank, as large as they may
/// bend. Throws InputError where no equilibrium is found: the body can fly away, or what pulls is too strong for the mesh. Not collective.
std::vector<Quad> calc_equilibrium(Domain& domain, const std::vector<HeldNode>& held, const std::vector<PulledNode>& pulled);

struct ElasticMode {
  double omega_rad_s = 0.0;
  std::vector<Quad> shape;  // (nodes) of which the largest displacement is 1, and its largest component positive
};
inline constexpr int kMostModes = 20;

/// The mode of this number, 1 to kMostModes, from the lowest, about rest; rigid motion does not count. held: their displacements are 0
/// whatever is given. Domain of one rank. Throws InputError when there are not so many. Not collective.
ElasticMode calc_mode(Domain& domain, const std::vector<HeldNode>& held, int number);

}  // namespace carillon::transient
