// Method:     From the roots down each front hands its interval of ranks on to its children in proportion to their subtrees' work, the
//             largest first. Ends near a whole number move there, so that a rank is not in two groups for nothing; what is shorter than a
//             small part of a rank goes to one rank whole. The path is found by playing the elimination through: each rank does the
//             subtrees that it has alone, then its shares of the shared fronts in the order in which these become ready.
// Source:     Pothen and Sun 1993, A mapping algorithm for parallel sparse Cholesky factorization (proportional mapping); Gupta, Karypis,
//             Kumar 1997, Highly scalable parallel algorithms for sparse matrix factorization (subtree to subcube, fronts in two
//             dimensions).
// Deviations: shares are fractions of ranks, not whole ranks; shared fronts go by readiness, not in postorder, in which a rank of two
//             groups makes one wait (at 64 ranks the path was four times as long).
#include "precompute/ldlt/mapping.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace carillon::ldlt {
namespace {

constexpr double kSnap = 0.08;   // of a rank
constexpr double kSmall = 0.06;  // of a rank: a subtree that straddles two ranks goes to one of them
constexpr double kTile = 72;     // rows and columns of a tile of a shared front
constexpr double kColumns = 16;  // of a solve
constexpr double kEntriesBound = 1.25;

std::vector<std::vector<std::int32_t>> list_children(const Forest& forest, std::vector<std::int32_t>& roots) {
  std::vector<std::vector<std::int32_t>> children(forest.supernodes.size());
  for (std::size_t s = 0; s < forest.supernodes.size(); ++s) {
    const std::int32_t parent = forest.supernodes[s].parent;
    (parent < 0 ? roots : children[static_cast<std::size_t>(parent)]).push_back(static_cast<std::int32_t>(s));
  }
  return children;
}

/// Of the trailing rows and columns of a front, the numbers of the lower triangle.
double count_triangle_of(double rows) { return rows * (rows + 1) / 2; }

/// The order of events of an elimination: when each rank is free, and when each front is complete [operations].
class Replay {
 public:
  Replay(const Forest& forest, const Mapping& mapping, bool is_gang)
      : forest_(forest),
        mapping_(mapping),
        is_gang_(is_gang),
        free_(static_cast<std::size_t>(mapping.ranks()), 0.0),
        ready_(forest.supernodes.size(), 0.0),
        waiting_(forest.supernodes.size(), 0) {}

  double run() {
    std::vector<std::int32_t> shared;
    for (std::size_t s = 0; s < forest_.supernodes.size(); ++s) {
      const auto front = static_cast<std::int32_t>(s);
      if (mapping_.owner(front) >= 0) {
        eliminate(front, {{mapping_.owner(front), 1.0}});
      } else {
        shared.push_back(front);
        const std::int32_t parent = forest_.supernodes[s].parent;
        if (parent >= 0) ++waiting_[static_cast<std::size_t>(parent)];
      }
    }
    std::vector<std::int32_t> open;
    for (const std::int32_t s : shared)
      if (waiting_[static_cast<std::size_t>(s)] == 0) open.push_back(s);
    while (!open.empty()) {
      const auto next = std::min_element(open.begin(), open.end(), [this](std::int32_t a, std::int32_t b) { return start(a) < start(b); });
      const std::int32_t s = *next;
      open.erase(next);
      eliminate(s, mapping_.list_shares(s));
      const std::int32_t parent = forest_.supernodes[static_cast<std::size_t>(s)].parent;
      if (parent >= 0 && --waiting_[static_cast<std::size_t>(parent)] == 0) open.push_back(parent);
    }
    return *std::max_element(free_.begin(), free_.end());
  }

 private:
  /// When all ranks of a front are free and its children complete.
  double start(std::int32_t front) const {
    double time = ready_[static_cast<std::size_t>(front)];
    for (const FrontShare& share : mapping_.list_shares(front)) time = std::max(time, free_[static_cast<std::size_t>(share.rank)]);
    return time;
  }

  void eliminate(std::int32_t front, const std::vector<FrontShare>& shares) {
    const Supernode& node = forest_.supernodes[static_cast<std::size_t>(front)];
    const double operations = count_flops(node.width, node.size());
    const double together = is_gang_ ? start(front) : 0;
    double largest = 0;
    for (const FrontShare& share : shares) largest = std::max(largest, share.fraction);
    double complete = 0;
    for (const FrontShare& share : shares) {
      double& free = free_[static_cast<std::size_t>(share.rank)];
      free = is_gang_ ? together + operations * largest
                      : std::max(ready_[static_cast<std::size_t>(front)], free) + operations * share.fraction;
      complete = std::max(complete, free);
    }
    if (node.parent >= 0) {
      double& ready = ready_[static_cast<std::size_t>(node.parent)];
      ready = std::max(ready, complete);
    }
  }

  const Forest& forest_;
  const Mapping& mapping_;
  bool is_gang_ = false;
  std::vector<double> free_;           // (ranks)
  std::vector<double> ready_;          // (fronts)
  std::vector<std::int32_t> waiting_;  // (fronts) shared children that are not complete
};

}  // namespace

Mapping::Mapping(const Forest& forest, int ranks, double operations_weight)
    : ranks_(ranks),
      operations_weight_(operations_weight),
      begin_(forest.supernodes.size(), 0.0),
      end_(forest.supernodes.size(), 0.0),
      owner_(forest.supernodes.size(), -1) {
  const std::size_t count = forest.supernodes.size();
  double operations = 0;
  double entries = 0;
  for (const Supernode& node : forest.supernodes) {
    operations += count_flops(node.width, node.size());
    entries += static_cast<double>(count_entries(node.width, node.size()));
  }
  std::vector<double> work(count, 0.0);  // of the subtree
  for (std::size_t s = 0; s < count; ++s) {
    const Supernode& node = forest.supernodes[s];
    work[s] += operations_weight * count_flops(node.width, node.size()) / operations +
               (1 - operations_weight) * static_cast<double>(count_entries(node.width, node.size())) / entries;
    if (node.parent >= 0) work[static_cast<std::size_t>(node.parent)] += work[s];
  }
  std::vector<std::int32_t> roots;
  const std::vector<std::vector<std::int32_t>> children = list_children(forest, roots);
  const auto divide = [&](std::vector<std::int32_t> fronts, double begin, double end) {
    double all = 0;
    for (const std::int32_t s : fronts) all += work[static_cast<std::size_t>(s)];
    std::stable_sort(fronts.begin(), fronts.end(),
                     [&](std::int32_t a, std::int32_t b) { return work[static_cast<std::size_t>(a)] > work[static_cast<std::size_t>(b)]; });
    double at = begin;
    for (const std::int32_t s : fronts) {
      begin_[static_cast<std::size_t>(s)] = at;
      at += all > 0 ? (end - begin) * work[static_cast<std::size_t>(s)] / all : 0;
      end_[static_cast<std::size_t>(s)] = std::min(at, end);
    }
  };
  divide(roots, 0, ranks);
  for (std::size_t s = count; s-- > 0;) {  // parents before children
    if (owner_[s] < 0) {
      const double length = end_[s] - begin_[s];
      const double begin = std::abs(begin_[s] - std::round(begin_[s])) < kSnap ? std::round(begin_[s]) : begin_[s];
      const double end = std::abs(end_[s] - std::round(end_[s])) < kSnap ? std::round(end_[s]) : end_[s];
      if (length > 0.5 && end > begin) {
        begin_[s] = begin;
        end_[s] = end;
      }
      const int first = std::clamp(static_cast<int>(std::floor(begin_[s] + 1e-9)), 0, ranks - 1);
      const int last = std::clamp(static_cast<int>(std::ceil(end_[s] - 1e-9)) - 1, first, ranks - 1);
      if (first == last)
        owner_[s] = first;
      else if (length < kSmall || (children[s].empty() && length < 1))
        owner_[s] = std::clamp(static_cast<int>((begin_[s] + end_[s]) / 2), 0, ranks - 1);
    }
    if (owner_[s] < 0) {
      divide(children[s], begin_[s], end_[s]);
      continue;
    }
    for (const std::int32_t child : children[s]) {
      begin_[static_cast<std::size_t>(child)] = begin_[s];
      end_[static_cast<std::size_t>(child)] = end_[s];
      owner_[static_cast<std::size_t>(child)] = owner_[s];
    }
  }
}

std::vector<FrontShare> Mapping::list_shares(std::int32_t front) const {
  const auto s = static_cast<std::size_t>(front);
  if (owner_[s] >= 0) return {{owner_[s], 1.0}};
  std::vector<FrontShare> shares;
  const double length = end_[s] - begin_[s];
  for (int rank = static_cast<int>(std::floor(begin_[s] + 1e-9)); rank < ranks_ && rank < end_[s] - 1e-9; ++rank)
    shares.push_back({rank, (std::min(end_[s], rank + 1.0) - std::max(begin_[s], static_cast<double>(rank))) / length});
  return shares;
}

double MappingCounts::fullest_ratio() const {
  return *std::max_element(entries.begin(), entries.end()) * static_cast<double>(entries.size()) / total_entries;
}

MappingCounts count_mapping(const Forest& forest, const Mapping& mapping) {
  const auto ranks = static_cast<std::size_t>(mapping.ranks());
  MappingCounts counts;
  for (std::vector<double>* list : {&counts.operations, &counts.entries, &counts.messages, &counts.bytes, &counts.solve_bytes})
    list->assign(ranks, 0.0);
  std::vector<std::int32_t> planned(ranks, 0);
  std::vector<std::int32_t> roots;
  const std::vector<std::vector<std::int32_t>> children = list_children(forest, roots);
  for (std::size_t s = 0; s < forest.supernodes.size(); ++s) {
    const Supernode& node = forest.supernodes[s];
    const auto front = static_cast<std::int32_t>(s);
    const double operations = count_flops(node.width, node.size());
    const auto entries = static_cast<double>(count_entries(node.width, node.size()));
    counts.total_operations += operations;
    counts.total_entries += entries;
    const std::vector<FrontShare> shares = mapping.list_shares(front);
    for (const FrontShare& share : shares) {
      counts.operations[static_cast<std::size_t>(share.rank)] += operations * share.fraction;
      counts.entries[static_cast<std::size_t>(share.rank)] += entries * share.fraction;
    }
    const auto add_update = [&](std::int32_t child) {  // an update matrix, from its ranks to those of the front
      const double numbers = count_triangle_of(3.0 * static_cast<double>(forest.supernodes[static_cast<std::size_t>(child)].rows.size()));
      const std::vector<FrontShare> from = mapping.list_shares(child);
      for (const FrontShare& share : shares) {
        double elsewhere = 0;
        for (const FrontShare& sender : from)
          if (sender.rank != share.rank) {
            elsewhere += sender.fraction;
            counts.messages[static_cast<std::size_t>(share.rank)] += 1;
          }
        counts.bytes[static_cast<std::size_t>(share.rank)] += 8 * numbers * share.fraction * elsewhere;
      }
    };
    for (const std::int32_t child : children[s]) add_update(child);
    if (shares.size() < 2) continue;
    ++counts.shared_fronts;
    counts.shared_operations += operations;
    counts.shared_entries += entries;
    const double group = static_cast<double>(shares.size());
    const double grid_rows = std::floor(std::sqrt(group));
    const double grid_columns = group / grid_rows;
    const double size = 3.0 * node.size();
    const double width = 3.0 * node.width;
    for (const FrontShare& share : shares) {
      const auto rank = static_cast<std::size_t>(share.rank);
      planned[rank] += 1 + static_cast<std::int32_t>(children[s].size());
      for (double begin = 0; begin < width; begin += kTile) {
        // A panel's tiles along the rank's row of the grid, and transposed along its column, where it has not made them itself.
        const double panel = std::min(kTile, width - begin);
        const double below = size - begin - panel;
        counts.messages[rank] += (grid_columns > 1 ? 1 - 1 / grid_columns : 0) + (grid_rows > 1 ? 1 - 1 / grid_rows : 0);
        counts.bytes[rank] += 8 * panel * below * ((1 - 1 / grid_columns) / grid_rows + (1 - 1 / grid_rows) / grid_columns);
        counts.solve_bytes[rank] += 2 * 8 * kColumns * panel * (1 - 1 / group);
      }
    }
  }
  for (const std::int32_t fronts : planned) counts.most_planned_fronts = std::max(counts.most_planned_fronts, fronts);
  counts.path_operations = Replay(forest, mapping, false).run();
  counts.gang_operations = Replay(forest, mapping, true).run();
  return counts;
}

Mapping choose_mapping(const Forest& forest, int ranks) {
  Mapping best(forest, ranks, 1.0);
  double best_path = std::numeric_limits<double>::infinity();
  double best_entries = std::numeric_limits<double>::infinity();
  for (const double weight : {1.0, 0.7, 0.4}) {
    Mapping candidate(forest, ranks, weight);
    const MappingCounts counts = count_mapping(forest, candidate);
    const double entries = std::max(counts.fullest_ratio(), kEntriesBound);
    if (entries > best_entries || (entries == best_entries && counts.path_operations >= best_path)) continue;
    best = std::move(candidate);
    best_path = counts.path_operations;
    best_entries = entries;
  }
  return best;
}

}  // namespace carillon::ldlt
