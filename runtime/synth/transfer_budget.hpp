// Distributes transfer look-ups over bodies with directivity.
#pragma once

#include <algorithm>
#include <cstdint>

namespace carillon::synth {

/// Distributes the look-ups of a block by the demand of the last blocks. Bodies without demand, asleep or not, and those with a rising
/// demand share the rest, at least a quarter. Invariant: a pure function of the state at the start of a block, independent of clocks and
/// block sizes; all shares together are at most 5/4 of `whole`, except for bodies with more ears, which look up one transfer per ear.
class TransferBudget {
 public:
  /// Begins a block. `needs`: total find_need() of all bodies.
  void begin(double whole, int bodies, std::int64_t needs) noexcept {
    const auto asked = static_cast<double>(needs);
    scale_ = asked > whole ? whole / asked : 1.0;
    extra_ = std::max(whole - asked, 0.25 * whole) / std::max(1, bodies);
  }

  /// Share of a body of this need.
  int find_share(int need) const noexcept {
    return static_cast<int>(std::min(scale_ * static_cast<double>(need) + extra_, 1e6));  // more than any body has
  }

  /// Need of a body: decaying maximum of its demand. Long-lasting weights are demanded in one block of sixteen.
  static int find_need(int before, int demand) noexcept { return std::max(demand, before * 15 / 16); }

 private:
  double scale_ = 1.0, extra_ = 0.0;
};

}  // namespace carillon::synth
