// Values of a scene's keys and their ranges. Invalid values are an InputError "file:line: ...".
#pragma once

#include <string_view>

#include "runtime/base/ranges.hpp"
#include "runtime/base/vector.hpp"
#include "runtime/material/material.hpp"

namespace carillon::scene {

inline constexpr double kLongestS = 3600.0;
inline constexpr double kFarthestM = 1e4;     // of positions; half a minute at the speed of sound
inline constexpr double kMaxSpeedMs = 300.0;  // below the speed of sound in air
inline constexpr double kRoughestM = 1e-3;    // larger heights belong to the shape
inline constexpr double kSoftestPa = 100.0;   // a jelly
inline constexpr double kStiffestPa = 1e13;   // ten times diamond

using base::read_vector;
using base::read_within;

/// Three required numbers of magnitude at most `limit`.
Vec3 read_required_vector(base::Object& object, std::string_view key, double limit = kFarthestM);
/// A direction, of length 1.
Vec3 read_direction(base::Object& object, std::string_view key);
/// Reads elastic constants from the key "material"; nullptr without the key.
const material::Material* read_material(base::Object& object, double& young_modulus_pa, double& poisson_ratio);

}  // namespace carillon::scene
