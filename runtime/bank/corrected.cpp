// Method: shapes are kept, except those of modes coupled by the air (mixing.hpp). Reactions (lambda times mass times phi) and the frequency
//   dependence of radiation gains follow the new frequencies. With multipoles, frequencies are those in air, radiation adds its decay, and
//   gains correspond to the radiated power.
// Source: docs/equations.md E6, E7, E10; docs/error-bars.md.
#include "runtime/bank/corrected.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "runtime/bank/air.hpp"
#include "runtime/bank/mixing.hpp"
#include "runtime/bank/radiation_gain.hpp"
#include "runtime/bank/select.hpp"
#include "runtime/base/sort_order.hpp"

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

namespace {

/// Replaces frequencies and decays by the corrected ones, already in order.
void take_corrected(Bank& bank) {
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
  bank.multipoles.is_in_decay = false;
  bank.discretisation_error_cents = std::move(corrected.error_cents);
}

/// Scales the nonlinear energy to modes at these frequencies.
void scale_nonlinear(Bank& bank, const std::vector<double>& freq_hz) {
  if (bank.quartic.is_empty()) return;
  std::vector<double> factor;
  for (std::size_t m = 0; m < bank.mode_count(); ++m) factor.push_back(freq_hz[m] / bank.freq_hz(m));
  scale_frequencies(bank.quartic, factor);
}

/// Nonlinear energy of the modes that mix_modes() will make, at their frequencies in air: sums over the body's modes at their corrected
/// frequencies, if any. Parts without nonlinear energy are omitted.
void mix_nonlinear(Bank& bank) {
  const Mixing& mixing = bank.multipoles.mixing;
  if (bank.quartic.is_empty() || mixing.is_empty()) return;
  if (!bank.corrected.is_empty()) scale_nonlinear(bank, bank.corrected.freq_hz);
  const std::size_t n = bank.quartic.mode_count();
  std::vector<std::size_t> place(bank.mode_count() + kRigidMotions, n);
  for (std::size_t i = 0; i < n; ++i) place[bank.quartic.modes[i]] = i;
  std::vector<double> parts(n * n);
  std::size_t at = 0;
  for (std::size_t m = 0; m < mixing.count.size(); ++m)
    for (std::int32_t k = 0; k < mixing.count[m]; ++k, ++at) {
      const std::size_t to = place[m], from = place[mixing.motion[at]];
      if (to < n && from < n) parts[to * n + from] = mixing.part[at];
    }
  combine_modes(bank.quartic, parts);
}

/// Decays and gains in air, from the multipoles.
void add_radiation(Bank& bank) {
  Multipoles& air = bank.multipoles;
  for (std::size_t m = 0; m < bank.mode_count(); ++m)
    if (!air.is_in_decay) bank.decay_per_s[m] += air.decay_per_s[m];
  bank.radiation_gain = calc_far_gains(air);
  air.is_in_decay = true;
}

}  // namespace

double find_played_hz(const Bank& bank, std::size_t mode) {
  if (!bank.multipoles.is_empty()) return bank.multipoles.freq_hz[mode];
  return bank.corrected.is_empty() ? bank.freq_hz(mode) : bank.corrected.freq_hz[mode];
}

std::vector<std::size_t> sort_played_modes(const Bank& bank) {
  return bank.multipoles.is_empty() ? sort_modes(bank) : base::find_sort_order(bank.multipoles.freq_hz);
}

Bank calc_corrected(Bank bank) {
  const bool has_air = !bank.multipoles.is_empty();
  if (bank.corrected.is_empty() && !has_air) return bank;
  if (const std::vector<std::size_t> order = sort_played_modes(bank); !std::is_sorted(order.begin(), order.end()))
    select_modes(bank, order);
  if (bank.multipoles.mixing.is_empty()) scale_nonlinear(bank, has_air ? bank.multipoles.freq_hz : bank.corrected.freq_hz);
  mix_nonlinear(bank);
  if (!bank.corrected.is_empty()) take_corrected(bank);
  if (has_air) {
    mix_modes(bank);
    // Reactions are those of the elastic body at its frequencies without air.
    for (std::size_t m = 0; m < bank.mode_count(); ++m) {
      const double omega = 2.0 * std::numbers::pi * bank.multipoles.freq_hz[m];
      bank.eigenvalue_rad2_s2[m] = omega * omega;
    }
    add_radiation(bank);
  }
  bank.proof.reset();
  return bank;
}

Bank choose_frequencies(Bank bank, Frequencies frequencies) {
  if (frequencies == Frequencies::kCorrected) return calc_corrected(std::move(bank));
  if (!bank.multipoles.is_empty()) {
    if (!bank.quartic.is_empty() && !bank.multipoles.mixing.is_empty()) {
      mix_nonlinear(bank);
      // From the frequencies in air back to those of the mesh, as calc_corrected() does.
      std::vector<double> factor;
      for (std::size_t m = 0; m < bank.mode_count(); ++m) factor.push_back(bank.freq_hz(m) / bank.multipoles.freq_hz[m]);
      scale_frequencies(bank.quartic, factor);
    }
    mix_modes(bank);  // the modes of the multipoles
    add_radiation(bank);
  }
  return bank;
}

}  // namespace carillon::bank
