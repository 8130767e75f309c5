// Method:     shapes stay, frequencies change: reactions, which are lambda times mass times phi, and what the radiation gain has of the
//             frequency, follow.
// Source:     docs/equations.md E6, E7; docs/error-bars.md.
// Deviations: none.
#include "runtime/bank/corrected.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "runtime/bank/radiation_gain.hpp"
#include "runtime/bank/select.hpp"

namespace carillon::bank {

const char* describe(Correction correction) {
  switch (correction) {
    case Correction::kOneMesh:
      return "one mesh";
    case Correction::kTwoMeshes:
      return "two meshes";
    case Correction::kRough:
      return "rough";
    case Correction::kStiff:
      return "too stiff";
    case Correction::kLumped:
      return "lumped T10";
    case Correction::kDisputed:
      return "disputed";
  }
  return "unknown";
}

Bank calc_corrected(Bank bank) {
  if (bank.corrected.is_empty()) return bank;
  if (const std::vector<std::size_t> order = sort_modes(bank); !std::is_sorted(order.begin(), order.end())) select_modes(bank, order);
  Corrected corrected = std::exchange(bank.corrected, {});
  const double area = calc_outer_area_m2(bank);
  const std::size_t reactions = 6 * bank.supports.count();
  for (std::size_t m = 0; m < bank.mode_count(); ++m) {
    const double mesh = std::sqrt(bank.eigenvalue_rad2_s2[m]), omega = 2.0 * std::numbers::pi * corrected.freq_hz[m];
    bank.eigenvalue_rad2_s2[m] = omega * omega;
    bank.radiation_gain[m] *= calc_radiation_gain(omega, 1.0, area) / calc_radiation_gain(mesh, 1.0, area);
    const double force = omega * omega / (mesh * mesh);
    for (std::size_t i = m * reactions; i < (m + 1) * reactions; ++i) bank.supports.reaction[i] *= force;
  }
  bank.decay_per_s = std::move(corrected.decay_per_s);
  bank.discretisation_error_cents = std::move(corrected.error_cents);
  bank.proof.reset();
  return bank;
}

Bank choose_frequencies(Bank bank, Frequencies frequencies) {
  return frequencies == Frequencies::kCorrected ? calc_corrected(std::move(bank)) : bank;
}

}  // namespace carillon::bank
