// Joints and cords of a scene file.
#pragma once

#include "runtime/base/document.hpp"
#include "runtime/scene/scene_bodies.hpp"

namespace carillon::scene {

/// Reads the keys "joints" and "cords" of a scene. Throws InputError "file:line: ...".
void parse_joints(base::Object& root, const Names& names, Scene& scene);

/// Appends the tables "joint" and "cord" of the reference.
void describe_joint_keys(std::vector<base::KeyTable>& tables);

}  // namespace carillon::scene
