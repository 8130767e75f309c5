// Simbody's bodies of a test scene. C++17.
#pragma once

#include <carillon/simbody.h>

#include <vector>

#include "tests/system/engines/engine.hpp"

namespace carillon::testing {

inline SimTK::MassProperties make_mass(const Solid& solid) {
  const auto& i = solid.inertia_kg_m2;
  return {solid.mass_kg, SimTK::Vec3(0), SimTK::Inertia(i[0], i[1], i[2])};
}

/// The state of a system whose free bodies begin as the solids do; same order.
inline SimTK::State make_state(const SimTK::MultibodySystem& system, const std::vector<SimTK::MobilizedBody::Free>& bodies,
                               const std::vector<Solid>& solids) {
  const auto to_simbody = [](const double(&x)[3]) { return SimTK::Vec3(x[0], x[1], x[2]); };
  SimTK::State state = system.realizeTopology();
  system.realizeModel(state);
  for (std::size_t i = 0; i < solids.size(); ++i) {
    const auto& q = solids[i].rotation;
    const SimTK::Rotation turn(SimTK::Quaternion(q[0], q[1], q[2], q[3]));
    bodies[i].setQToFitTransform(state, SimTK::Transform(turn, to_simbody(solids[i].position_m)));
    bodies[i].setUToFitVelocity(state, SimTK::SpatialVec(to_simbody(solids[i].spin_rad_s), to_simbody(solids[i].velocity_m_s)));
  }
  return state;
}

}  // namespace carillon::testing
