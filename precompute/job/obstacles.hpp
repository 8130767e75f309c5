// Rigid bodies that deformable bodies can touch.
#pragma once

#include <variant>

#include "runtime/base/vector.hpp"

namespace carillon::job {

/// Half-space, ball and box, at rest.
struct PlaneObstacle {
  Vec3 point_m{}, normal{0, 0, 1};  // unit, to the free side
};
struct BallObstacle {
  Vec3 centre_m{};
  double radius_m = 0;
};
struct BoxObstacle {
  Vec3 min_m{}, max_m{};
};
using RigidObstacle = std::variant<PlaneObstacle, BallObstacle, BoxObstacle>;

/// A homogeneous ball in free flight that rolls by friction.
struct BallStriker {
  double radius_m = 0, mass_kg = 0;
  Vec3 position_m{}, velocity_m_s{}, spin_rad_s{};

  double find_inertia_kg_m2() const { return 0.4 * mass_kg * radius_m * radius_m; }
};

}  // namespace carillon::job
