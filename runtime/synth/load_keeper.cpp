// Method:     load = fixed part (receivers, strikes, overhead) + part in proportion to the work, both unknown: the work is scaled
//             repeatedly by wanted over measured load, which reduces the error each time to the fixed part's share. Decreases at once,
//             increases by at most a tenth per step, and not within a tenth of the target.
#include "runtime/synth/load_keeper.hpp"

#include <algorithm>
#include <limits>

namespace carillon::synth {
namespace {

constexpr double kShortestS = 0.02;
constexpr double kSlack = 0.9;      // of the share: below it the budget grows
constexpr double kSteepest = 0.25;  // smallest factor in one step
constexpr double kRise = 1.1;
constexpr double kMin = 1e5;       // mode-samples/s: two modes at 48 kHz; a floor from which factors of 1.1 lead up again
constexpr double kUnbound = 64.0;  // times the work: no limit any more

}  // namespace

double LoadKeeper::calc_budget(double share, const LoadSample& now, double budget) noexcept {
  const double played_s = now.played_s - last_.played_s, busy_s = now.busy_s - last_.busy_s;
  if (played_s >= 0.0 && played_s < kShortestS) return budget;
  const double work = (now.mode_samples - last_.mode_samples) / played_s;
  last_ = now;
  if (!(played_s > 0.0) || !(busy_s >= 0.0) || !(work >= 0.0) || !(share > 0.0)) return budget;
  const double load = busy_s / played_s;
  if (load > share) return std::max(kMin, std::min(budget, work) * std::max(kSteepest, share / load));
  if (load > kSlack * share) return budget;
  const double more = budget * kRise;
  return more > kUnbound * std::max(work, kMin) ? std::numeric_limits<double>::infinity() : more;
}

void LoadKeeper::keep(Synthesiser& synthesiser, double share, double busy_s) noexcept {
  synthesiser.set_budget(calc_budget(share,
                                     {.busy_s = busy_s,
                                      .played_s = synthesiser.get_time_s(),
                                      .mode_samples = static_cast<double>(synthesiser.get_counters().mode_samples)},
                                     synthesiser.get_budget()));
}

}  // namespace carillon::synth
