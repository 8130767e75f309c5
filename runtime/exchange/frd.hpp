// Modes of CalculiX (.frd of *FREQUENCY with *NODE FILE, U) as a bank.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "runtime/bank/bank.hpp"
#include "runtime/material/material.hpp"

namespace carillon::exchange {

/// Units of the model: metres, kilograms, seconds; or millimetres, tonnes, seconds.
enum class FrdUnits { kMetre, kMillimetre };

struct FrdReading {
  const material::Material* material = nullptr;  // mass, contact stiffness and damping; required
  FrdUnits units = FrdUnits::kMetre;
  bool are_units_given = false;  // else bodies above 10 units are refused
};

/// Bank of the surface of the tetrahedra and of all modes but the rigid ones. Frequencies and shapes are the file's: their accuracy is
/// unknown. Throws InputError "name:line: ...".
bank::Bank parse_frd(std::string_view bytes, const std::string& name, const FrdReading& reading, std::vector<std::string>* notes = nullptr);

}  // namespace carillon::exchange
