// Method: From the roots down each front divides its interval of ranks among its children in proportion to the work of their subtrees. Ends
// near an integer are rounded, so that no rank joins two groups needlessly; a subtree shorter than a small part of a rank goes to one rank.
// The path length results from a simulation of the elimination: each rank processes its own subtrees, then its shares of the shared fronts
// in the order in which they become ready. Differences to the sources: shares are fractions of ranks, not whole ranks; shared fronts are
// processed by readiness, not in postorder, in which a rank in two groups makes one wait (four times the path at 64 ranks).
// Source: Pothen and Sun 1993, A mapping algorithm for parallel sparse Cholesky factorization (proportional mapping); Gupta, Karypis, Kumar
// 1997, Highly scalable parallel algorithms for sparse matrix factorization (subtree to subcube, fronts in two dimensions).
#include "precompute/ldlt/mapping.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <queue>
#include <utility>

#include "precompute/ldlt/kernels.hpp"
#include "precompute/ldlt/level_subtrees.hpp"
#include "precompute/ldlt/tile_map.hpp"

namespace carillon::ldlt {
namespace {

constexpr double kSnap = 0.08;   // in ranks
constexpr double kSmall = 0.06;  // in ranks: a shorter subtree that straddles two ranks goes to one of them
constexpr double kEntriesBound = 1.25;
constexpr double kLeastShare = 0.2;   // relative to an even share
constexpr double kSharedFront = 5e6;  // operations equivalent to the messages of a shared front, factorisation and solves: 0.1 ms
// Rank counts up to which subtrees are levelled, and several grains are tried; beyond, the mapping takes longer than it saves.
constexpr int kMostLevelled = 64;
constexpr int kMostGrains = 16;

/// Share of each rank in a shared front by the tiles assigned; empty if the front has one rank.
struct FrontParts {
  std::vector<double> operations;
  std::vector<std::int64_t> entries;
};

FrontParts deal_tiles(const FrontCost& front, const std::vector<FrontShare>& shares) {
  const TileMap map(front.width, front.rows, shares);
  return {map.count_operations(), map.count_entries()};
}

std::vector<FrontParts> list_parts(const std::vector<FrontCost>& fronts, const Mapping& mapping) {
  std::vector<FrontParts> all(fronts.size());
  for (std::size_t s = 0; s < fronts.size(); ++s)
    if (mapping.owner(static_cast<std::int32_t>(s)) < 0) all[s] = deal_tiles(fronts[s], mapping.list_shares(static_cast<std::int32_t>(s)));
  return all;
}

/// Fractions such that ranks that become free at these times [operations] finish a front of this many operations together; a rank that is
/// free too late gets `least`.
void level(std::vector<FrontShare>& shares, const std::vector<double>& times, double operations, double least) {
  std::vector<double> sorted = times;
  std::sort(sorted.begin(), sorted.end());
  double end = 0, sum = 0;
  for (std::size_t k = 0; k < sorted.size(); ++k) {
    sum += sorted[k];
    end = (sum + operations) / static_cast<double>(k + 1);
    if (k + 1 < sorted.size() && end <= sorted[k + 1]) break;
  }
  double all = 0;
  for (std::size_t place = 0; place < shares.size(); ++place) {
    shares[place].fraction = std::max((end - times[place]) / operations, least);
    all += shares[place].fraction;
  }
  for (FrontShare& share : shares) share.fraction /= all;
}

/// Simulated elimination: times [operations] at which each rank becomes free and each front is complete.
class Replay {
 public:
  Replay(const std::vector<FrontCost>& fronts, const Mapping& mapping, std::vector<FrontParts> shared, bool is_gang)
      : fronts_(fronts),
        mapping_(mapping),
        shared_(std::move(shared)),
        is_gang_(is_gang),
        free_(static_cast<std::size_t>(mapping.ranks()), 0.0),
        ready_(fronts.size(), 0.0),
        waiting_(fronts.size(), 0) {}

  double run() {
    std::vector<std::int32_t> shared;
    for (std::size_t s = 0; s < fronts_.size(); ++s) {
      const auto front = static_cast<std::int32_t>(s);
      if (mapping_.owner(front) >= 0) {
        eliminate(front, {{mapping_.owner(front), 1.0}});
      } else {
        shared.push_back(front);
        const std::int32_t parent = fronts_[s].parent;
        if (parent >= 0) ++waiting_[parent];
      }
    }
    for (const std::int32_t s : shared)
      if (waiting_[s] == 0) open_.emplace(start(s), s);
    while (!open_.empty()) {
      // Start times only increase, so the first entry whose time is still valid is the earliest.
      const auto [known, s] = open_.top();
      open_.pop();
      const double now = start(s);
      if (now > known) {
        open_.emplace(now, s);
        continue;
      }
      if (levelled_ != nullptr) level_front(s);
      eliminate(s, (levelled_ != nullptr ? *levelled_ : mapping_).list_shares(s));
      order_.push_back(s);
      const std::int32_t parent = fronts_[s].parent;
      if (parent >= 0 && --waiting_[parent] == 0) open_.emplace(start(parent), parent);
    }
    return *std::max_element(free_.begin(), free_.end());
  }

  /// The same, with shares of each shared front chosen so that its ranks finish together. They are stored in `levelled`, which starts as a
  /// copy of the mapping; shares given to the constructor are ignored.
  double run(Mapping& levelled) {
    levelled_ = &levelled;
    return run();
  }

  /// Shared fronts in the order of their start.
  std::vector<std::int32_t> take_order() { return std::move(order_); }

 private:
  /// Time at which all ranks of a front are free and its children are complete.
  double start(std::int32_t front) const {
    double time = ready_[front];
    for (const FrontShare& share : mapping_.list_shares(front)) time = std::max(time, free_[share.rank]);
    return time;
  }

  void level_front(std::int32_t front) {
    std::vector<FrontShare> shares = mapping_.list_shares(front);
    std::vector<double> times;
    for (const FrontShare& share : shares) times.push_back(std::max(free_[share.rank], ready_[front]));
    level(shares, times, fronts_[front].operations, kLeastShare / static_cast<double>(shares.size()));
    shared_[front] = deal_tiles(fronts_[front], shares);
    levelled_->set_shares(front, std::move(shares));
  }

  void eliminate(std::int32_t front, const std::vector<FrontShare>& shares) {
    const FrontCost& cost = fronts_[front];
    const std::vector<double>& parts = shared_[front].operations;
    const auto find_operations = [&](std::size_t place) { return parts.empty() ? cost.operations : parts[place]; };
    const double together = is_gang_ ? start(front) : 0;
    double largest = 0;
    for (std::size_t place = 0; place < shares.size(); ++place) largest = std::max(largest, find_operations(place));
    double complete = 0;
    for (std::size_t place = 0; place < shares.size(); ++place) {
      double& free = free_[shares[place].rank];
      free = is_gang_ ? together + largest : std::max(ready_[front], free) + find_operations(place);
      complete = std::max(complete, free);
    }
    if (cost.parent >= 0) {
      double& ready = ready_[cost.parent];
      ready = std::max(ready, complete);
    }
  }

  using Start = std::pair<double, std::int32_t>;  // time and front

  const std::vector<FrontCost>& fronts_;
  const Mapping& mapping_;
  std::vector<FrontParts> shared_;
  bool is_gang_ = false;
  Mapping* levelled_ = nullptr;
  std::vector<double> free_;           // (ranks)
  std::vector<double> ready_;          // (fronts)
  std::vector<std::int32_t> waiting_;  // (fronts) incomplete shared children
  std::priority_queue<Start, std::vector<Start>, std::greater<>> open_;
  std::vector<std::int32_t> order_;
};

}  // namespace

std::vector<std::vector<std::int32_t>> list_children(const std::vector<FrontCost>& fronts, std::vector<std::int32_t>& roots) {
  std::vector<std::vector<std::int32_t>> children(fronts.size());
  for (std::size_t s = 0; s < fronts.size(); ++s) {
    const std::int32_t parent = fronts[s].parent;
    (parent < 0 ? roots : children[parent]).push_back(static_cast<std::int32_t>(s));
  }
  return children;
}

std::vector<FrontCost> list_costs(const Forest& forest) {
  std::vector<FrontCost> fronts;
  for (const Supernode& node : forest.supernodes)
    fronts.push_back({node.parent, node.width, static_cast<std::int32_t>(node.rows.size()), count_flops(node.width, node.size()),
                      static_cast<double>(count_entries(node.width, node.size()))});
  return fronts;
}

Mapping::Mapping(const std::vector<FrontCost>& fronts, int ranks, double operations_weight, double grain)
    : ranks_(ranks),
      operations_weight_(operations_weight),
      begin_(fronts.size(), 0.0),
      end_(fronts.size(), 0.0),
      owner_(fronts.size(), -1) {
  const std::size_t count = fronts.size();
  double operations = 0, entries = 0;
  for (const FrontCost& front : fronts) {
    operations += front.operations;
    entries += front.entries;
  }
  std::vector<double> work(count, 0.0);  // work of the subtree
  for (std::size_t s = 0; s < count; ++s) {
    const FrontCost& front = fronts[s];
    work[s] += operations_weight * front.operations / operations + (1 - operations_weight) * front.entries / entries;
    if (front.parent >= 0) work[front.parent] += work[s];
  }
  std::vector<std::int32_t> roots;
  const std::vector<std::vector<std::int32_t>> children = list_children(fronts, roots);
  // In the order of the forest, which follows the ranks of the rows.
  const auto divide = [&](const std::vector<std::int32_t>& siblings, double begin, double end) {
    double all = 0;
    for (const std::int32_t s : siblings) all += work[s];
    double at = begin;
    for (const std::int32_t s : siblings) {
      begin_[s] = at;
      at += all > 0 ? (end - begin) * work[s] / all : 0;
      end_[s] = std::min(at, end);
    }
  };
  divide(roots, 0, ranks);
  for (std::size_t s = count; s-- > 0;) {  // parents before children
    if (owner_[s] < 0) {
      const double length = end_[s] - begin_[s];
      const double begin = std::abs(begin_[s] - std::round(begin_[s])) < grain * kSnap ? std::round(begin_[s]) : begin_[s];
      const double end = std::abs(end_[s] - std::round(end_[s])) < grain * kSnap ? std::round(end_[s]) : end_[s];
      if (length > 0.5 && end > begin) {
        begin_[s] = begin;
        end_[s] = end;
      }
      if (fronts[s].parent >= 0) {  // the ranks of a front are a subset of those of its parent
        begin_[s] = std::max(begin_[s], begin_[fronts[s].parent]);
        end_[s] = std::min(end_[s], end_[fronts[s].parent]);
      }
      const int first = std::clamp(static_cast<int>(std::floor(begin_[s] + 1e-9)), 0, ranks - 1);
      const int last = std::clamp(static_cast<int>(std::ceil(end_[s] - 1e-9)) - 1, first, ranks - 1);
      if (first == last)
        owner_[s] = first;
      else if (length < grain * kSmall || (children[s].empty() && length < 1))
        owner_[s] = std::clamp(static_cast<int>((begin_[s] + end_[s]) / 2), 0, ranks - 1);
    }
    if (owner_[s] < 0) {
      divide(children[s], begin_[s], end_[s]);
      continue;
    }
    for (const std::int32_t child : children[s]) {
      begin_[child] = begin_[s];
      end_[child] = end_[s];
      owner_[child] = owner_[s];
    }
  }
}

void Mapping::share(std::int32_t front, std::int32_t as) {
  const std::size_t to = front;
  owner_[to] = -1;
  begin_[to] = begin_[as];
  end_[to] = end_[as];
}

std::vector<FrontShare> Mapping::list_shares(std::int32_t front) const {
  const std::size_t s = front;
  if (owner_[s] >= 0) return {{owner_[s], 1.0}};
  if (!given_shares_.empty() && !given_shares_[s].empty()) return given_shares_[s];
  std::vector<FrontShare> shares;
  const double length = end_[s] - begin_[s];
  for (int rank = static_cast<int>(std::floor(begin_[s] + 1e-9)); rank < ranks_ && rank < end_[s] - 1e-9; ++rank)
    shares.push_back({rank, (std::min(end_[s], rank + 1.0) - std::max(begin_[s], static_cast<double>(rank))) / length});
  return shares;
}

void Mapping::set_shares(std::int32_t front, std::vector<FrontShare> shares) {
  given_shares_.resize(owner_.size());
  given_shares_[front] = std::move(shares);
}

double MappingCounts::fullest_ratio() const {
  return *std::max_element(entries.begin(), entries.end()) * static_cast<double>(entries.size()) / total_entries;
}

MappingCounts count_mapping(const std::vector<FrontCost>& fronts, const Mapping& mapping) {
  const std::size_t ranks = mapping.ranks();
  MappingCounts counts;
  counts.operations.assign(ranks, 0.0);
  counts.entries.assign(ranks, 0.0);
  const std::vector<FrontParts> shared = list_parts(fronts, mapping);
  std::vector<std::int32_t> shared_of_rank(ranks, 0);
  for (std::size_t s = 0; s < fronts.size(); ++s) {
    const FrontCost& cost = fronts[s];
    const auto front = static_cast<std::int32_t>(s);
    counts.total_operations += cost.operations;
    counts.total_entries += cost.entries;
    if (mapping.owner(front) >= 0) {
      counts.operations[mapping.owner(front)] += cost.operations;
      counts.entries[mapping.owner(front)] += cost.entries;
      continue;
    }
    ++counts.shared_fronts;
    counts.shared_operations += cost.operations;
    counts.shared_entries += cost.entries;
    const std::vector<FrontShare> shares = mapping.list_shares(front);
    for (std::size_t place = 0; place < shares.size(); ++place) {
      ++shared_of_rank[shares[place].rank];
      counts.operations[shares[place].rank] += shared[s].operations[place];
      counts.entries[shares[place].rank] += static_cast<double>(shared[s].entries[place]);
    }
  }
  for (const std::int32_t count : shared_of_rank) counts.most_shared_fronts = std::max(counts.most_shared_fronts, count);
  counts.path_operations = Replay(fronts, mapping, shared, false).run();
  return counts;
}

double calc_gang_operations(const std::vector<FrontCost>& fronts, const Mapping& mapping) {
  return Replay(fronts, mapping, list_parts(fronts, mapping), true).run();
}

Mapping choose_mapping(const std::vector<FrontCost>& fronts, int ranks) {
  Mapping best(fronts, ranks, 1.0);
  double best_cost = std::numeric_limits<double>::infinity();
  double best_entries = std::numeric_limits<double>::infinity();
  const auto consider = [&](const Mapping& candidate) {
    const MappingCounts counts = count_mapping(fronts, candidate);
    const double entries = std::max(counts.fullest_ratio(), kEntriesBound);
    const double cost = counts.path_operations + kSharedFront * counts.most_shared_fronts;
    if (entries > best_entries || (entries == best_entries && cost >= best_cost)) return;
    best = candidate;
    best_cost = cost;
    best_entries = entries;
  };
  const auto consider_levelled = [&](const Mapping& candidate) {
    consider(candidate);
    Mapping levelled = candidate;
    Replay(fronts, candidate, std::vector<FrontParts>(fronts.size()), false).run(levelled);
    consider(levelled);
  };
  for (const double weight : {1.0, 0.7, 0.4})
    for (const double grain : {1.0, 0.5, 0.25, 0.12}) {
      const Mapping candidate(fronts, ranks, weight, grain);
      consider_levelled(candidate);
      if (ranks <= kMostLevelled) {
        Mapping moved = candidate;
        level_subtrees(fronts, moved);
        consider_levelled(moved);
      }
      if (ranks > kMostGrains) break;
    }
  return best;
}

std::vector<std::int32_t> order_shared(const std::vector<FrontCost>& fronts, const Mapping& mapping) {
  const std::vector<FrontParts> shared = list_parts(fronts, mapping);
  Replay replay(fronts, mapping, shared, false);
  replay.run();
  return replay.take_order();
}

}  // namespace carillon::ldlt
