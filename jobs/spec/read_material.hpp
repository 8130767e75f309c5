// A material from its JSON object.
#pragma once

#include <array>

#include "jobs/spec/material.hpp"
#include "runtime/config/document.hpp"

namespace carillon::spec {

/// Reads and validates one material. The damping must not be negative anywhere on `band_hz`. Throws InputError.
Material read_material(config::Object material, const std::array<double, 2>& band_hz);

}  // namespace carillon::spec
