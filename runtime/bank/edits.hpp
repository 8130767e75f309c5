// Another density, stiffness, size or damping of a body without another solve.
#pragma once

#include <array>
#include <optional>
#include <string>

#include "runtime/bank/bank.hpp"

namespace carillon::bank {

struct Edits {
  double density_scale = 1.0;
  double stiffness_scale = 1.0;  // of both Lame constants: Poisson's ratio stays
  double size_scale = 1.0;       // of all lengths
  // Damping in place of the bank's law; one of the two at most.
  std::optional<std::array<double, 2>> alphas{};  // Rayleigh: alpha1 [s], alpha2 [1/s]
  std::optional<Damping> damping{};               // "internal_friction", "caughey" or "loss_table", with its numbers
};

/// In words what an edit leaves out of this bank, for its user; empty when it is nothing. Multipoles go with another density or stiffness:
/// modes then meet the air at other wave numbers.
std::string describe_dropped(const Bank& bank, const Edits& edits);

/// The bank of the edited body: what a solve of it gives, on the same mesh. Modes, decays, shapes, surface, rigid-body data, material,
/// band, proof and radiation gains all follow, and the provenance says what was done to what. Decays follow the damping law with its
/// numbers as they are, at the new frequencies. `radiation_gain` is OSG02's, as in every bank. Multipoles follow another size exactly, stay
/// with another damping, and are dropped otherwise: describe_dropped(). Of a bank that choose_frequencies() has made, the law is taken at
/// the frequencies in air. A body that is not the same in all directions (wood) takes another size alone. Throws InputError when a scale is
/// not within 1e-6 to 1e6, when an alpha is negative or not finite, when a damping law is not one of those, has numbers out of range or
/// makes a mode swell, and for what means nothing to a body of several materials or directions. Not for an audio thread.
Bank calc_edited(const Bank& bank, const Edits& edits);

}  // namespace carillon::bank
