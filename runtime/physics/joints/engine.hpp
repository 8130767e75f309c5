// Interface of the module with Simbody: one function, found by its name.
#pragma once

#include <vector>

#include "runtime/physics/joints/mechanism.hpp"

namespace carillon::joints {

inline constexpr const char* kEngineFile = "carillon-joints.so";
inline constexpr const char* kEngineName = "carillon_make_mechanism_1";
using MakeMechanism = Mechanism* (*)(const std::vector<Member>& members, const std::vector<Joint>& joints, const Vec3& gravity);

}  // namespace carillon::joints
