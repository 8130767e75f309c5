#include "runtime/bank/select.hpp"

#include <algorithm>
#include <cmath>

#include "runtime/base/sort_order.hpp"

namespace carillon::bank {
namespace {

/// values: (modes, width), or empty.
template <typename T>
void select_values(std::vector<T>& values, const std::vector<std::size_t>& chosen, std::size_t width = 1) {
  if (values.empty()) return;
  std::vector<T> selected;
  selected.reserve(chosen.size() * width);
  for (const std::size_t mode : chosen) {
    const auto first = values.begin() + static_cast<std::ptrdiff_t>(mode * width);
    selected.insert(selected.end(), first, first + static_cast<std::ptrdiff_t>(width));
  }
  values = std::move(selected);
}

/// Renumbers groups of degenerate modes; groups of one are dropped. kept: ascending.
void renumber_groups(Proof& proof, const std::vector<std::size_t>& kept) {
  std::size_t groups = 0;
  for (std::size_t g = 0; g < proof.cluster_first.size(); ++g) {
    const auto place = [&](std::int64_t mode) {
      return std::lower_bound(kept.begin(), kept.end(), static_cast<std::size_t>(mode)) - kept.begin();
    };
    const std::int64_t first = place(proof.cluster_first[g]), end = place(proof.cluster_first[g] + proof.cluster_count[g]);
    if (end - first < 2) continue;
    proof.cluster_first[groups] = first;
    proof.cluster_count[groups++] = end - first;
  }
  proof.cluster_first.resize(groups);
  proof.cluster_count.resize(groups);
}

/// Frequency [Hz] between the mode `gone` and the modes below it, not below the band's end; 0 if nothing separates them.
double find_end_between(const Bank& bank, std::size_t gone) {
  constexpr double kClear = 8.0, kGap = 1e-9;  // of the uncertainty of a mode; relative
  const double low_hz = std::max(bank.band_hz[1], gone > 0 ? bank.freq_hz(gone - 1) : 0.0), high_hz = bank.freq_hz(gone);
  const double unsure_cents = bank.algebraic_error_cents.empty() ? 0.0 : kClear * bank.algebraic_error_cents[gone];
  return high_hz > low_hz * std::exp2(unsure_cents / 1200) * (1 + kGap) ? std::sqrt(0.5 * (low_hz * low_hz + high_hz * high_hz)) : 0.0;
}

/// Ends the proof at `end_hz` below the mode `gone` and all above it.
void end_proof(const Bank& bank, double end_hz, std::size_t gone, Proof& proof) {
  const std::int64_t below = proof.below.back() - static_cast<std::int64_t>(bank.mode_count() - gone);
  while (proof.cut_hz.size() > 1 && proof.cut_hz.back() >= end_hz) {
    proof.cut_hz.pop_back();
    proof.below.pop_back();
    proof.margin.pop_back();
  }
  const double end = end_hz * end_hz;
  const auto calc_margin = [&](double hz) { return std::abs(hz * hz - end) / end; };
  proof.cut_hz.push_back(end_hz);
  proof.below.push_back(below);
  proof.margin.push_back(std::min({calc_margin(bank.freq_hz(gone)), gone > 0 ? calc_margin(bank.freq_hz(gone - 1)) : 1.0, 1.0}));
  proof.found = static_cast<std::int64_t>(gone);
  proof.method += "; at the upper end what the count above it leaves less the modes between";
}

}  // namespace

std::vector<std::size_t> sort_modes(const Bank& bank) {
  return base::find_sort_order(bank.corrected.is_empty() ? bank.eigenvalue_rad2_s2 : bank.corrected.freq_hz);
}

void select_modes(Bank& bank, const std::vector<std::size_t>& chosen) {
  bank.packing.reset();
  const std::size_t before = bank.mode_count();
  std::vector<std::int16_t> row(chosen.size() * 3);
  for (std::size_t v = 0; v < bank.vertex_count(); ++v) {  // in place: rows only shrink
    for (std::size_t i = 0; i < chosen.size(); ++i) std::copy_n(&bank.shape[(v * before + chosen[i]) * 3], 3, &row[3 * i]);
    std::copy(row.begin(), row.end(), bank.shape.begin() + static_cast<std::ptrdiff_t>(v * row.size()));
  }
  bank.shape.resize(bank.vertex_count() * row.size());
  for (auto* values : {&bank.decay_per_s, &bank.residual, &bank.radiation_gain, &bank.shape_scale, &bank.algebraic_error_cents,
                       &bank.discretisation_error_cents, &bank.facet_error_cents, &bank.corrected.freq_hz, &bank.corrected.decay_per_s,
                       &bank.corrected.error_cents, &bank.eigenvalue_rad2_s2}) {
    select_values(*values, chosen);
  }
  select_values(bank.corrected.correction, chosen);
  if (!bank.multipoles.is_empty()) bank.multipoles = select_multipoles(bank.multipoles, chosen);
  bank.quartic = select_coupled(bank.quartic, chosen);
  bank.sensitivities = select_sensitive(bank.sensitivities, chosen);
  select_values(bank.supports.reaction, chosen, 6 * bank.supports.count());
  select_values(bank.supports.energy, chosen, bank.supports.count());
}

namespace {

void keep(Bank& bank, const std::vector<std::size_t>& kept) {
  select_modes(bank, kept);
  if (bank.proof) renumber_groups(*bank.proof, kept);
}

void drop_below_band(Bank& bank) {
  std::vector<std::size_t> kept;
  for (std::size_t m = 0; m < bank.mode_count(); ++m) {
    if (is_above_begin(bank.corrected.freq_hz[m], bank.band_hz[0]))
      kept.push_back(m);
    else if (bank.proof)
      bank.proof->below_band_hz.push_back(bank.freq_hz(m));
  }
  if (kept.size() < bank.mode_count()) keep(bank, kept);
}

void drop_above_band(Bank& bank) {
  std::vector<std::size_t> kept;
  for (std::size_t m = 0; m < bank.mode_count(); ++m)
    if (is_below_end(bank.corrected.freq_hz[m], bank.band_hz[1])) kept.push_back(m);
  if (kept.size() == bank.mode_count()) return;
  std::size_t first_gone = 0;
  while (first_gone < kept.size() && kept[first_gone] == first_gone) ++first_gone;
  const double end_hz = first_gone == kept.size() && bank.complete ? find_end_between(bank, first_gone) : 0.0;
  if (bank.proof && end_hz > 0.0)
    end_proof(bank, end_hz, first_gone, *bank.proof);
  else if (bank.proof)
    bank.proof->complete_below_hz = bank.freq_hz(first_gone);
  keep(bank, kept);
}

}  // namespace

void keep_band(Bank& bank) {
  if (bank.corrected.is_empty()) return;
  drop_above_band(bank);
  drop_below_band(bank);
}

void keep_lowest(Bank& bank, std::size_t count) {
  if (count >= bank.mode_count()) return;
  std::vector<std::size_t> kept = sort_modes(bank);
  const std::size_t first_gone = *std::min_element(kept.begin() + static_cast<std::ptrdiff_t>(count), kept.end());
  const double complete_below_hz = bank.freq_hz(first_gone);
  const bool is_head = first_gone == count;  // also the lowest of the mesh
  kept.resize(count);
  std::sort(kept.begin(), kept.end());
  keep(bank, kept);
  bank.complete = false;
  if (!bank.proof) return;
  if (double& below_hz = bank.proof->complete_below_hz; below_hz > 0.0)
    below_hz = std::min(below_hz, complete_below_hz);
  else if (!is_head)
    below_hz = complete_below_hz;
}

}  // namespace carillon::bank
