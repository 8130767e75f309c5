// Modes coupled by the air: sums of elastic modes and rigid motions.
#pragma once

#include <array>
#include <cstddef>

#include "runtime/bank/bank.hpp"

namespace carillon::bank {

/// Rigid motions of a free body.
inline constexpr std::size_t kRigidMotions = 6;

/// Rigid motions with unit modal mass, mass-orthogonal: three translations along the mesh axes, three rotations about the centre of mass,
/// about the columns of L^-T with inertia L L^T (Cholesky).
class RigidMotions {
 public:
  /// Positive mass and positive definite inertia: calc_checks().
  explicit RigidMotions(const RigidBody& rigid);
  /// Motion 0 .. 5 at a point in mesh axes [kg^-1/2].
  Vec3 find(std::size_t motion, const Vec3& place_m) const;

 private:
  Vec3 centre_m_{};
  double translation_ = 0.0;        // kg^-1/2
  std::array<Vec3, 3> rotation_{};  // kg^-1/2 m^-1
};

/// Replaces the shapes by those of the modes in air and clears the mixture: shapes and reactions are sums; decays without radiation and
/// strain energy shares are weighted by squared parts. Frequencies, radiation and gains are left to the caller. No effect without coupling.
void mix_modes(Bank& bank);

}  // namespace carillon::bank
