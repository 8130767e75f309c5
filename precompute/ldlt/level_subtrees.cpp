// Method: Repeatedly the rank with the most work gives a subtree away, or exchanges one, whichever levels the two ranks best. If no move
// helps, the root of its smallest subtree above half of the gap is shared, so that its children can be given away. No move is undone, so
// the maximum never increases. A front that all ranks share is ignored: it can be shared evenly in any case.
// Source: Fiduccia and Mattheyses 1982 (moves by gain), applied to ranks instead of halves.
#include "precompute/ldlt/level_subtrees.hpp"

#include <algorithm>
#include <cstdint>

namespace carillon::ldlt {
namespace {

/// Subtrees below shared fronts that belong to one rank, and the work of these ranks.
class Levelling {
 public:
  Levelling(const std::vector<FrontCost>& fronts, Mapping& mapping)
      : fronts_(fronts), mapping_(mapping), work_(fronts.size(), 0.0), load_(static_cast<std::size_t>(mapping.ranks()), 0.0) {
    std::vector<std::int32_t> roots;
    children_ = list_children(fronts, roots);
    for (std::size_t s = 0; s < fronts.size(); ++s) {
      const auto front = static_cast<std::int32_t>(s);
      work_[s] += fronts[s].operations;
      if (fronts[s].parent >= 0) work_[fronts[s].parent] += work_[s];
      add_front(front, 1);
      if (mapping.owner(front) >= 0 && fronts[s].parent >= 0 && mapping.owner(fronts[s].parent) < 0) subtrees_.push_back(front);
    }
  }

  /// Moves a subtree from the rank with the most work to another, or exchanges two, whichever levels the two ranks best. False if no move
  /// helps.
  bool exchange() {
    const int most = find_most();
    double best = kUneven * load(most);
    std::int32_t given = -1, taken = -1;
    int to = -1;
    const auto consider = [&](std::int32_t subtree, std::int32_t back, int rank) {
      const double moved = work(subtree) - (back < 0 ? 0 : work(back));
      const double gain = std::min(moved, load(most) - load(rank) - moved);
      if (gain <= best) return;
      best = gain;
      given = subtree;
      taken = back;
      to = rank;
    };
    for (const std::int32_t subtree : subtrees_) {
      if (mapping_.owner(subtree) != most) continue;
      for (const FrontShare& share : list_takers(subtree))
        if (share.rank != most) consider(subtree, -1, share.rank);
      for (const std::int32_t back : subtrees_)
        if (mapping_.owner(back) != most && can_take(subtree, mapping_.owner(back)) && can_take(back, most))
          consider(subtree, back, mapping_.owner(back));
    }
    if (given < 0) return false;
    give(given, to);
    if (taken >= 0) give(taken, most);
    return true;
  }

  /// Shares the root of the smallest subtree of the rank with the most work that is too large to be moved. False if the ranks are level or
  /// there is no such subtree.
  bool split() {
    const int most = find_most();
    std::int32_t best = -1;
    for (const std::int32_t subtree : subtrees_) {
      if (mapping_.owner(subtree) != most || children_[subtree].empty()) continue;
      double least = load(most);
      for (const FrontShare& share : list_takers(subtree)) least = std::min(least, load(share.rank));
      const double gap = load(most) - least;
      if (gap < 4 * kUneven * load(most) || work(subtree) < gap / 2 || (best >= 0 && work(subtree) >= work(best))) continue;
      best = subtree;
    }
    if (best < 0) return false;
    add_front(best, -1);
    mapping_.share(best, fronts_[best].parent);
    add_front(best, 1);
    std::erase(subtrees_, best);
    const std::vector<std::int32_t>& below = children_[best];
    subtrees_.insert(subtrees_.end(), below.begin(), below.end());
    return true;
  }

 private:
  static constexpr double kUneven = 1e-3;

  double work(std::int32_t subtree) const { return work_[subtree]; }
  double load(int rank) const { return load_[rank]; }
  int find_most() const { return static_cast<int>(std::max_element(load_.begin(), load_.end()) - load_.begin()); }
  std::vector<FrontShare> list_takers(std::int32_t subtree) const { return mapping_.list_shares(fronts_[subtree].parent); }
  bool can_take(std::int32_t subtree, int rank) const {
    const std::vector<FrontShare> takers = list_takers(subtree);
    return std::any_of(takers.begin(), takers.end(), [&](const FrontShare& share) { return share.rank == rank; });
  }
  /// A front that all ranks share is ignored: it can be shared evenly in any case.
  void add_front(std::int32_t front, int sign) {
    const std::vector<FrontShare> shares = mapping_.list_shares(front);
    if (shares.size() == load_.size()) return;
    for (const FrontShare& share : shares) load_[share.rank] += sign * fronts_[front].operations / static_cast<double>(shares.size());
  }
  void give(std::int32_t subtree, int to) {
    load_[mapping_.owner(subtree)] -= work(subtree);
    load_[to] += work(subtree);
    std::vector<std::int32_t> open{subtree};
    while (!open.empty()) {
      const std::int32_t front = open.back();
      open.pop_back();
      mapping_.set_owner(front, to);
      const std::vector<std::int32_t>& below = children_[front];
      open.insert(open.end(), below.begin(), below.end());
    }
  }

  const std::vector<FrontCost>& fronts_;
  Mapping& mapping_;
  std::vector<std::vector<std::int32_t>> children_;
  std::vector<double> work_;            // (fronts) work of the subtree
  std::vector<double> load_;            // (ranks)
  std::vector<std::int32_t> subtrees_;  // roots of the subtrees
};

}  // namespace

void level_subtrees(const std::vector<FrontCost>& fronts, Mapping& mapping) {
  Levelling levelling(fronts, mapping);
  const int most = 8 * mapping.ranks();
  for (int changes = 0; changes < most; ++changes)
    if (!levelling.exchange() && !levelling.split()) return;
}

}  // namespace carillon::ldlt
