// Momentum, angular momentum about the origin and kinetic energy of all bodies.
#pragma once

#include "runtime/physics/rigid/space.hpp"

namespace carillon::rigid {

struct Momenta {
  Vec3 linear{}, angular{};
  double kinetic_j = 0.0;
};

/// Of a Space, or of Bodies.
template <typename World>
Momenta add_up(const World& space) {
  Momenta sum;
  for (int i = 0; i < static_cast<int>(space.states().size()); ++i) {
    const State& s = space.state(i);
    const Vec3 p = space.solid(i).mass_kg * s.velocity;
    sum.linear = sum.linear + p;
    sum.angular = sum.angular + cross(s.centre, p) + s.momentum;
    sum.kinetic_j += calc_kinetic(space.solid(i), s);
  }
  return sum;
}

}  // namespace carillon::rigid
