#include "precompute/mesh/distributed/level_elements.hpp"

#include <algorithm>
#include <limits>
#include <numeric>

#include "precompute/comm/places.hpp"

namespace carillon::mesh {

std::vector<Transfer> plan_transfers(std::vector<std::int64_t> counts) {
  std::vector<Transfer> transfers;
  const auto ranks = static_cast<std::int64_t>(counts.size());
  const std::int64_t all = std::accumulate(counts.begin(), counts.end(), std::int64_t{0});
  const auto target = [&](std::size_t rank) { return all / ranks + (static_cast<std::int64_t>(rank) < all % ranks ? 1 : 0); };
  std::size_t to = 0;
  for (std::size_t from = 0; from < counts.size(); ++from)
    for (std::int64_t end = 0; counts[from] > target(from);) {
      while (counts[to] >= target(to)) ++to;
      const std::int64_t moved = std::min(counts[from] - target(from), target(to) - counts[to]);
      counts[from] -= moved;
      counts[to] += moved;
      transfers.push_back({static_cast<int>(from), static_cast<int>(to), end += moved});
    }
  return transfers;
}

void level_elements(const comm::Communicator& comm, std::vector<std::int32_t>& rank, const std::vector<std::int32_t>& position) {
  const auto make_key = [](std::int32_t place) {
    return static_cast<std::uint64_t>(std::int64_t{place} - std::numeric_limits<std::int32_t>::min());
  };
  std::vector<std::vector<std::uint64_t>> keys;  // (ranks) keys of their elements, ascending
  std::vector<std::int64_t> counts;
  comm.agree([&] {
    keys.resize(comm.size());
    for (std::size_t e = 0; e < rank.size(); ++e) keys[rank[e]].push_back(make_key(position[e]));
    for (std::vector<std::uint64_t>& list : keys) {
      std::sort(list.begin(), list.end());
      counts.push_back(static_cast<std::int64_t>(list.size()));
    }
  });
  comm.sum(counts);
  std::vector<Transfer> transfers;
  std::vector<std::int64_t> wanted;
  std::vector<std::size_t> first(comm.size() + 1, 0);  // first transfer of each rank
  comm.agree([&] {
    transfers = plan_transfers(counts);
    for (const Transfer& one : transfers) {
      wanted.push_back(one.end);
      ++first[one.from + 1];
    }
    std::partial_sum(first.begin(), first.end(), first.begin());
  });
  const std::vector<std::uint64_t> cut =
      comm::find_places(comm, 32, wanted, [&](const std::vector<std::uint64_t>& trial, std::vector<std::int64_t>& below) {
        for (std::size_t k = 0; k < transfers.size(); ++k) {
          const std::vector<std::uint64_t>& list = keys[transfers[k].from];
          below[k] += std::lower_bound(list.begin(), list.end(), trial[k]) - list.begin();
        }
      });
  for (std::size_t e = 0; e < rank.size(); ++e) {
    const auto begin = cut.begin() + static_cast<std::ptrdiff_t>(first[rank[e]]);
    const auto end = cut.begin() + static_cast<std::ptrdiff_t>(first[rank[e] + 1]);
    const auto goes = std::upper_bound(begin, end, make_key(position[e]));
    if (goes != end) rank[e] = transfers[goes - cut.begin()].to;
  }
}

}  // namespace carillon::mesh
