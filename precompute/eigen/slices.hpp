// Intervals of lambda with the number of eigenvalues in them, and how they are cut.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

namespace carillon::eigen {

/// An interval of lambda and how many eigenvalues lie below its ends.
struct Slice {
  double low = 0;
  std::int64_t below_low = 0;
  double high = 0;
  std::int64_t below_high = 0;

  std::int64_t count() const { return below_high - below_low; }
};

/// Number of eigenvalues below lambda. Costs a factorisation.
using CountBelow = std::function<std::int64_t(double lambda)>;

/// Lowers the upper end until the slice holds `wanted` eigenvalues and few more; the slice itself when it holds no more than that.
Slice cut_to_lowest(const Slice& band, std::int64_t wanted, const CountBelow& count_below);

/// Cuts where the counts are about equal until no slice holds more than `most` eigenvalues; only a cluster narrower than 1e-4 of its lambda
/// stays in one piece. Ascending, without gaps.
std::vector<Slice> cut_into_slices(const Slice& band, std::int64_t most, const CountBelow& count_below);

}  // namespace carillon::eigen
