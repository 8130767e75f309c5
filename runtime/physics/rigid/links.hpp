// Links between bodies: joints, cords and the stops of joints.
#pragma once

#include <optional>
#include <vector>

#include "runtime/base/vector.hpp"
#include "runtime/physics/joints/mechanism.hpp"

namespace carillon::rigid {

/// End of travel of a hinge or slider. Positions and directions in mesh axes, from the centres of mass, or in the world.
struct Stop {
  bool turns = true;          // hinge; otherwise slider
  Vec3 at_a{}, at_b{};        // position of the joint
  Vec3 axis{};                // of b
  Vec3 lever_a{}, lever_b{};  // perpendicular to the axis, aligned at the start; hinge only
  double arm_m = 0.0;         // length of the lever to the stop; hinge only
  double max = 0.0;           // rad or m from the start, limit of the motion of a relative to b; negative if is_lower
  bool is_lower = false;
};

/// Inextensible massless cord between two anchors, each in mesh axes from the centre of mass of its body, or in the world.
struct Cord {
  int a = 0, b = -1;  // b may be -1: the world
  Vec3 at_a{}, at_b{};
  double length_m = 0.0;
  double restitution = 0.0;    // when becoming taut
  std::optional<Stop> stop{};  // set: a stop of a joint, which pushes, instead of a cord
};

/// All joints and cords. `body` and `to` of a joint are bodies of the space, or -1 or a fixed body: the world.
struct Links {
  std::vector<joints::Joint> joints;
  std::vector<Cord> cords;
};

}  // namespace carillon::rigid
