// Cut positions of a distributed sequence by item count.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "precompute/comm/communicator.hpp"

namespace carillon::comm {

/// Largest numbers with `bits` bits for which the count below is at most wanted[g]; counts ascend with the number. Bisection over the bits,
/// for all groups at once. count_below(numbers, counts) adds the counts of this rank. Collective.
template <typename CountBelow>
std::vector<std::uint64_t> find_places(const Communicator& comm, int bits, const std::vector<std::int64_t>& wanted,
                                       CountBelow&& count_below) {
  std::vector<std::uint64_t> value, trial;
  std::vector<std::int64_t> counts;
  comm.agree([&] {
    value.assign(wanted.size(), 0);
    trial = value;
    counts.resize(wanted.size());
  });
  for (int bit = bits - 1; bit >= 0; --bit) {
    for (std::size_t g = 0; g < wanted.size(); ++g) trial[g] = value[g] | std::uint64_t{1} << bit;
    std::fill(counts.begin(), counts.end(), 0);
    count_below(trial, counts);
    comm.sum(counts);
    for (std::size_t g = 0; g < wanted.size(); ++g)
      if (counts[g] <= wanted[g]) value[g] = trial[g];
  }
  return value;
}

}  // namespace carillon::comm
