// A material from its JSON object.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "precompute/job/material.hpp"
#include "runtime/base/document.hpp"

namespace carillon::job {

/// Reads and validates one material. The damping must not be negative anywhere on `band_hz`. What may be meant but seldom is (units of
/// another system, no damping at all, damping under which nothing swings) is added to `warnings`, a line each. Throws InputError.
Material read_material(base::Object material, const std::array<double, 2>& band_hz, std::vector<std::string>& warnings);

}  // namespace carillon::job
