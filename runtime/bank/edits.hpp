// Changes of density, stiffness, size or damping without a new solve.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "runtime/bank/bank.hpp"

namespace carillon::bank {

struct Edits {
  double density_scale = 1.0;
  double stiffness_scale = 1.0;  // both Lame constants: Poisson's ratio is kept
  double size_scale = 1.0;       // all lengths
  // Replacement of the bank's damping law; at most one of the two.
  std::optional<std::array<double, 2>> alphas{};  // Rayleigh: alpha1 [s], alpha2 [1/s]
  std::optional<Damping> damping{};               // "internal_friction", "caughey" or "loss_table", with its numbers
  std::vector<Cut> cuts{};  // of the bank's surface, before the change of size; to first order, of the frequencies only
};

/// Parts of this bank that the edit drops, for its user; empty if none. Multipoles are dropped with another density or stiffness, which
/// change the wave numbers in air.
std::string describe_dropped(const Bank& bank, const Edits& edits);

/// The bank of the edited body, equal to a solve on the same mesh. Modes, decays, shapes, surface, rigid-body data, material, band, proof
/// and radiation gains are adapted; the provenance records the edit. Decays follow the damping law at the new frequencies. `radiation_gain`
/// is OSG02's, as in all banks. Multipoles are exact under a change of size, kept under another damping, and dropped otherwise
/// (describe_dropped()). For a bank made by choose_frequencies() the law is evaluated at the frequencies in air. Anisotropic bodies (wood)
/// permit a change of size only. Throws InputError for scales outside 1e-6 to 1e6, negative or non-finite alphas, unknown damping laws,
/// numbers out of range or negative damping, and edits undefined for several materials or anisotropy. Not for audio threads.
Bank calc_edited(const Bank& bank, const Edits& edits);

}  // namespace carillon::bank
