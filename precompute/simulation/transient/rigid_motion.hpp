// Rigid motion of bodies, from their momentum and angular momentum.
#pragma once

#include <span>
#include <vector>

#include "precompute/simulation/transient/domain.hpp"
#include "precompute/simulation/transient/quad.hpp"
#include "runtime/base/vector.hpp"

namespace carillon::transient {

/// Swing axis of a body.
struct Hinge {
  bool is_there = false;
  Vec3 point_m{}, axis{};  // unit; 0 if all nodes coincide
};

/// Through the first position and the one farthest from it; at least one position.
Hinge make_hinge(std::span<const Vec3> places_m);

struct RigidMotion {
  Vec3 centre_m{}, velocity_m_s{}, spin_rad_s{};
  Vec3 calc_velocity(const Vec3& place_m) const { return velocity_m_s + cross(spin_rad_s, place_m - centre_m); }
};

/// For the bodies in is_wanted, zero for the others; about its hinge for a hinged body. Over all ranks, bit-identical on any number of
/// them. Collective.
std::vector<RigidMotion> calc_rigid_motions(const Domain& domain, const std::vector<Quad>& u, const std::vector<Quad>& v,
                                            const std::vector<char>& is_wanted, std::span<const Hinge> hinges);

}  // namespace carillon::transient
