// Rigid motion of bodies: that with their momentum and angular momentum.
#pragma once

#include <span>
#include <vector>

#include "precompute/simulation/transient/domain.hpp"
#include "precompute/simulation/transient/quad.hpp"
#include "runtime/base/vector.hpp"

namespace carillon::transient {

/// The line about which a body swings.
struct Hinge {
  bool is_there = false;
  Vec3 point_m{}, axis{};  // unit; 0 where all nodes are one point
};

/// Through the first place and the one farthest from it; of at least one place.
Hinge make_hinge(std::span<const Vec3> places_m);

struct RigidMotion {
  Vec3 centre_m{}, velocity_m_s{}, spin_rad_s{};
  Vec3 calc_velocity(const Vec3& place_m) const { return velocity_m_s + cross(spin_rad_s, place_m - centre_m); }
};

/// Of the bodies in is_wanted, at rest for the others; about its hinge where a body has one. Over all ranks, the same bits on any number
/// of them. Collective.
std::vector<RigidMotion> calc_rigid_motions(const Domain& domain, const std::vector<Quad>& u, const std::vector<Quad>& v,
                                            const std::vector<char>& is_wanted, std::span<const Hinge> hinges);

}  // namespace carillon::transient
