// Assignment of fronts to groups of ranks, and its predicted cost.
#pragma once

#include <cstdint>
#include <vector>

#include "precompute/ldlt/symbolic.hpp"

namespace carillon::ldlt {

/// Cost of a front, or of a subtree eliminated by one rank. Children precede their parents.
struct FrontCost {
  std::int32_t parent = -1;
  std::int32_t width = 0;  // pivot nodes; for a subtree: of its root
  std::int32_t rows = 0;   // nodes behind the pivots
  double operations = 0;
  double entries = 0;  // of L and D
};

/// Costs of all fronts of a forest.
std::vector<FrontCost> list_costs(const Forest& forest);

/// Children of each front, in order. roots: fronts without a parent are appended.
std::vector<std::vector<std::int32_t>> list_children(const std::vector<FrontCost>& fronts, std::vector<std::int32_t>& roots);

/// A rank and its fraction of the work of a front.
struct FrontShare {
  int rank = 0;
  double fraction = 1;
};

/// Proportional mapping: the subtree of a front has an interval of [0, ranks] with a length proportional to its work, divided into the
/// intervals of its children. A front belongs to all ranks that its interval intersects, in proportion to the overlap. Adjacent ranks share
/// subtrees, which suits ranks on the same machine.
class Mapping {
 public:
  /// operations_weight: weight of operations in the work of a subtree, 0 to 1; the rest is the weight of its entries of L. grain: scales
  /// the largest subtree that is assigned to one rank whole, 1: 0.06 ranks; smaller values share more fronts.
  Mapping(const std::vector<FrontCost>& fronts, int ranks, double operations_weight, double grain = 1);

  int ranks() const { return ranks_; }
  double operations_weight() const { return operations_weight_; }
  /// Rank that owns a front, -1 if it is shared.
  int owner(std::int32_t front) const { return owner_[front]; }
  /// Ranks of a front, ascending; the fractions add up to one. A front of one rank has a single share of 1.
  std::vector<FrontShare> list_shares(std::int32_t front) const;
  /// Assigns a front to one rank.
  void set_owner(std::int32_t front, int rank) { owner_[front] = rank; }
  /// Assigns a front to the ranks of another front.
  void share(std::int32_t front, std::int32_t as);
  /// Changes the fractions of the ranks of a shared front; they add up to one.
  void set_shares(std::int32_t front, std::vector<FrontShare> shares);

 private:
  int ranks_ = 1;
  double operations_weight_ = 1;
  std::vector<double> begin_;  // (fronts) interval of the subtree
  std::vector<double> end_;
  std::vector<int> owner_;
  std::vector<std::vector<FrontShare>> given_shares_;  // (fronts) set by set_shares(), or empty
};

/// Cost of a mapping, counted by tiles as the factorisation assigns them (tile_map.hpp).
struct MappingCounts {
  std::vector<double> operations;  // (ranks) of a factorisation
  std::vector<double> entries;     // (ranks) of L and D
  double total_operations = 0;
  double total_entries = 0;
  /// Operations on the critical path over fronts and ranks, if a rank starts its share of a front as soon as it is free and the children
  /// are complete.
  double path_operations = 0;
  double shared_operations = 0;  // in fronts of more than one rank
  double shared_entries = 0;
  std::int32_t shared_fronts = 0;
  std::int32_t most_shared_fronts = 0;  // largest number of shared fronts of one rank

  /// path_operations over total_operations / ranks; 1 is ideal.
  double path_ratio() const { return path_operations * static_cast<double>(operations.size()) / total_operations; }
  /// Entries of the fullest rank over the mean.
  double fullest_ratio() const;
};

MappingCounts count_mapping(const std::vector<FrontCost>& fronts, const Mapping& mapping);

/// path_operations if all ranks of a front started together and waited for the slowest.
double calc_gang_operations(const std::vector<FrontCost>& fronts, const Mapping& mapping);

/// The mapping with the shortest path, with a penalty per shared front, among several weights and grains whose fullest rank has at most
/// 1.25 times the mean entries; if none has, the mapping with the fewest entries on the fullest rank.
Mapping choose_mapping(const std::vector<FrontCost>& fronts, int ranks);

/// Shared fronts in the order in which their ranks are free and their children complete: children before parents. If all ranks use this
/// order, there is no deadlock.
std::vector<std::int32_t> order_shared(const std::vector<FrontCost>& fronts, const Mapping& mapping);

}  // namespace carillon::ldlt
