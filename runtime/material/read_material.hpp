// Materials in JSON: constants, a name in the table, or a name with overrides.
#pragma once

#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "runtime/base/document.hpp"
#include "runtime/material/material.hpp"

namespace carillon::material {

class MaterialTable;

/// Reads and validates a material. {"from": NAME} starts from a material of `table` (null: none) and may override elasticity, "axes" of an
/// orthotropic one, "density_kg_m3" and "damping". Damping must be non-negative on `band_hz`. Implausible values (wrong units, no damping,
/// overdamped band) append a line to `warnings`. Throws InputError.
Material read_material(base::Object material, const std::array<double, 2>& band_hz, std::vector<std::string>& warnings,
                       const MaterialTable* table = nullptr);

/// Reads the value of `key`: an object, or a name in the programs' table. `fallback`: name used if the key is missing, and as "from" of an
/// object that gives damping only; empty: none.
Material read_material(base::Object& parent, std::string_view key, const std::array<double, 2>& band_hz, std::vector<std::string>& warnings,
                       const std::string& fallback = "");

}  // namespace carillon::material
