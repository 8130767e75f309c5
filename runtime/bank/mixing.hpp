// Modes that the air couples: each a sum of modes of the elastic body and of its rigid motions.
#pragma once

#include <array>
#include <cstddef>

#include "runtime/bank/bank.hpp"

namespace carillon::bank {

/// Rigid motions of a free body.
inline constexpr std::size_t kRigidMotions = 6;

/// The rigid motions of a body with unit modal mass, and orthogonal to each other by its mass: three translations along the axes of the
/// mesh, three rotations about the centre of mass, about the columns of L^-T where the inertia is L L^T (Cholesky).
class RigidMotions {
 public:
  /// The mass is positive and the inertia positive definite: calc_checks().
  explicit RigidMotions(const RigidBody& rigid);
  /// Of motion 0 .. 5 at a place in the frame of the mesh [kg^-1/2].
  Vec3 find(std::size_t motion, const Vec3& place_m) const;

 private:
  Vec3 centre_m_{};
  double translation_ = 0.0;        // kg^-1/2
  std::array<Vec3, 3> rotation_{};  // kg^-1/2 m^-1
};

/// The bank with the shapes of its modes in air, and an empty mixture: shapes and reactions are sums, decays (without radiation) those that
/// the motion makes, weighed by the squares of the parts, and shares of the strain energy likewise. Frequencies, radiation and gains are
/// left to the caller. Does nothing to a bank whose modes the air does not couple.
void mix_modes(Bank& bank);

}  // namespace carillon::bank
