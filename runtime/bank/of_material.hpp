// Materials of the table applied to banks.
#pragma once

#include "runtime/bank/edits.hpp"
#include "runtime/material/material.hpp"

namespace carillon::bank {

/// Damping law of the material; Rayleigh's constants are in bank::Material.
Damping make_damping(const material::Material& material);

/// Edits (density, stiffness, damping) that change the bank's body to this material. Throws InputError if either is anisotropic, which
/// scaling cannot represent.
Edits make_edits(const Bank& bank, const material::Material& material);

/// Frequency error [cent] after make_edits(), which keeps the bank's Poisson's ratio: that of torsion, E / (1 + nu), larger than of
/// bending.
double calc_poisson_cents(const Bank& bank, const material::Material& material);

}  // namespace carillon::bank
