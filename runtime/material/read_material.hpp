// A material from its JSON: constants, a name of the table, or a name with some constants in place of the table's.
#pragma once

#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "runtime/base/document.hpp"
#include "runtime/material/material.hpp"

namespace carillon::material {

class MaterialTable;

/// Reads and validates one material. {"from": NAME} starts from a material of `table` (null: none) and may replace its elasticity, the
/// "axes" of an orthotropic one, "density_kg_m3" and "damping". The damping must not be negative anywhere on `band_hz`. Implausible values
/// (units of another system, no damping, over-damping of the band) are added to `warnings`, one line each. Throws InputError.
Material read_material(base::Object material, const std::array<double, 2>& band_hz, std::vector<std::string>& warnings,
                       const MaterialTable* table = nullptr);

/// The same of the value of `key`: an object, or a name of the table that programs use. `fallback`: a name of that table, taken where the
/// key is missing, and as "from" where an object gives a damping alone; empty: none.
Material read_material(base::Object& parent, std::string_view key, const std::array<double, 2>& band_hz, std::vector<std::string>& warnings,
                       const std::string& fallback = "");

}  // namespace carillon::material
