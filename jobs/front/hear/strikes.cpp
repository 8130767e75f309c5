#include "jobs/front/hear/strikes.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "runtime/bank/blows.hpp"

namespace carillon::hear {

std::vector<StruckMode> list_modes(const bank::Bank& bank, const std::vector<bank::HeardMode>& heard, std::size_t vertex,
                                   std::size_t count) {
  const std::vector<double> amplitudes = bank::calc_blow_amplitudes(bank, vertex, bank::calc_vertex_normals(bank)[vertex]);
  const double loudest = amplitudes.empty() ? 0.0 : *std::max_element(amplitudes.begin(), amplitudes.end());
  std::vector<StruckMode> modes;
  for (std::size_t m = 0; m < std::min(count, bank.mode_count()); ++m) {
    StruckMode mode{.heard = heard[m]};
    mode.error_cents =
        m < bank.discretisation_error_cents.size() ? bank.discretisation_error_cents[m] : std::numeric_limits<double>::infinity();
    if (m < bank.facet_error_cents.size()) mode.facet_cents = bank.facet_error_cents[m];
    mode.level_dba = amplitudes[m] > 0.0 ? 20.0 * std::log10(amplitudes[m] / loudest) : -std::numeric_limits<double>::infinity();
    modes.push_back(mode);
  }
  return modes;
}

}  // namespace carillon::hear
