// What a material of the table means for a bank.
#pragma once

#include "runtime/bank/edits.hpp"
#include "runtime/material/material.hpp"

namespace carillon::bank {

/// Its damping law; of Rayleigh's the constants stand in bank::Material.
Damping make_damping(const material::Material& material);

/// The edits that make a body of this material of the bank's: density, stiffness and damping. Throws InputError where one of the two is not
/// the same in all directions, which no scale makes of the other.
Edits make_edits(const Bank& bank, const material::Material& material);

/// How far frequencies may be off after make_edits(), since Poisson's ratio stays the bank's: of torsion, E / (1 + nu), which changes more
/// than bending [cent].
double calc_poisson_cents(const Bank& bank, const material::Material& material);

}  // namespace carillon::bank
