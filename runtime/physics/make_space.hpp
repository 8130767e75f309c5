// Bodies, joints and cords of a world's description as those of the rigid-body simulation.
#pragma once

#include <map>
#include <memory>

#include "runtime/drive/mode_sets.hpp"
#include "runtime/physics/rigid/space.hpp"
#include "runtime/physics/world.hpp"

namespace carillon::physics {

/// Makes bodies; those of one bank share their shape and their modes.
class SolidMaker {
 public:
  explicit SolidMaker(bool has_modes) : has_modes_(has_modes) {}
  /// Throws InputError for a surface that is no solid.
  rigid::Solid make(const BodySpec& body);

 private:
  bool has_modes_;
  std::map<const bank::Bank*, std::shared_ptr<const geometry::Shape>> shapes_;
  drive::ModeSets modes_;
};

/// Checks the description (InputError) and makes its bodies.
rigid::Space make_space(const WorldSpec& spec, const WorldOptions& options, SolidMaker& maker);
/// Checks that the start velocities are compatible with the joints (InputError).
void check_start(const WorldSpec& spec, const rigid::Space& space);
/// Pose and velocities of a body, to be checked before: check_entry().
rigid::State make_state(const BodySpec& body, const rigid::Solid& solid);

}  // namespace carillon::physics
