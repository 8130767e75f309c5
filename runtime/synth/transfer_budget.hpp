// How many transfers each body with directivity may look up in a block, so that all together stay within one bound.
#pragma once

#include <algorithm>
#include <cstdint>

namespace carillon::synth {

/// Shares the transfers of a block among bodies by what each has asked for in the last ones. Bodies that ask for nothing, asleep or not,
/// and those that ask for more than before share what is left, a quarter of all at least. Invariant: it is a pure function of what
/// is known when a block begins, so that neither a clock nor the sizes of calls decide; all shares together are at most 5/4 of `whole`, but
/// for bodies of more ears than that, which look up one transfer an ear.
class TransferBudget {
 public:
  /// A block begins. `needs`: find_need() of all bodies together.
  void begin(double whole, int bodies, std::int64_t needs) noexcept {
    const auto asked = static_cast<double>(needs);
    scale_ = asked > whole ? whole / asked : 1.0;
    extra_ = std::max(whole - asked, 0.25 * whole) / std::max(1, bodies);
  }

  /// The share of a body of this need.
  int find_share(int need) const noexcept {
    return static_cast<int>(std::min(scale_ * static_cast<double>(need) + extra_, 1e6));  // more than any body has
  }

  /// What a body needs: the most that it asked for in a block; what is past counts ever less. Weights that last long are asked for in one
  /// block of sixteen.
  static int find_need(int before, int demand) noexcept { return std::max(demand, before * 15 / 16); }

 private:
  double scale_ = 1.0, extra_ = 0.0;
};

}  // namespace carillon::synth
