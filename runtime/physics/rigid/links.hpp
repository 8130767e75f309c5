// Links between bodies: joints, cords and the stops of joints.
#pragma once

#include <optional>
#include <vector>

#include "runtime/base/vector.hpp"
#include "runtime/physics/joints/mechanism.hpp"

namespace carillon::rigid {

/// The end of the way of a hinge or a slider. Places and directions in the axes of the meshes, from the centres of mass, or in the world.
struct Stop {
  bool turns = true;          // a hinge; else a slider
  Vec3 at_a{}, at_b{};        // the joint
  Vec3 axis{};                // of b
  Vec3 lever_a{}, lever_b{};  // across the axis, alike at the start; of a hinge
  double arm_m = 0.0;         // of the lever at whose end the stop is; of a hinge
  double max = 0.0;           // rad or m from the start that a may turn or move against b; negative where is_lower
  bool is_lower = false;
};

/// An inextensible massless cord between two places, each in the axes of its body's mesh from the centre of mass, or in the world.
struct Cord {
  int a = 0, b = -1;  // bodies; b may be -1: the world
  Vec3 at_a{}, at_b{};
  double length_m = 0.0;
  double restitution = 0.0;    // when it comes taut
  std::optional<Stop> stop{};  // set: this is no cord but a stop of a joint, which pushes
};

/// All joints and cords. Of a joint, `body` and `to` are bodies of the space, -1 or a fixed one: the world.
struct Links {
  std::vector<joints::Joint> joints;
  std::vector<Cord> cords;
};

}  // namespace carillon::rigid
