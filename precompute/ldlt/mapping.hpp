// Which ranks share which fronts, and what that costs before any number is computed.
#pragma once

#include <cstdint>
#include <vector>

#include "precompute/ldlt/symbolic.hpp"

namespace carillon::ldlt {

/// A front, or a subtree that one rank eliminates whole, as the mapping sees it. Children stand before their parents.
struct FrontCost {
  std::int32_t parent = -1;
  std::int32_t width = 0;  // pivot nodes; of a subtree: of its root
  std::int32_t rows = 0;   // nodes behind the pivots
  double operations = 0;
  double entries = 0;  // of L and D
};

/// Every front of a forest.
std::vector<FrontCost> list_costs(const Forest& forest);

/// The children of each front, in their order. roots: appended to, those without a parent.
std::vector<std::vector<std::int32_t>> list_children(const std::vector<FrontCost>& fronts, std::vector<std::int32_t>& roots);

/// A rank and its fraction of a front's work.
struct FrontShare {
  int rank = 0;
  double fraction = 1;
};

/// Proportional mapping: the subtree of a front has an interval of [0, ranks], as long as its share of the whole work, and the intervals of
/// its children lie in it one after the other. A front belongs to the ranks that its interval meets, to each by the overlap. Neighbouring
/// ranks share subtrees, so that they may stay on one machine.
class Mapping {
 public:
  /// operations_weight: how much a subtree's operations count in its work, 0 to 1; the rest are its entries of L. grain: how large the part
  /// of a rank is that goes to one rank whole, 1: 0.06; less shares more fronts.
  Mapping(const std::vector<FrontCost>& fronts, int ranks, double operations_weight, double grain = 1);

  int ranks() const { return ranks_; }
  double operations_weight() const { return operations_weight_; }
  /// The rank that has a front whole, -1: it is shared.
  int owner(std::int32_t front) const { return owner_[front]; }
  /// Its ranks, ascending; the fractions add up to one. A front that one rank has is one share of 1.
  std::vector<FrontShare> list_shares(std::int32_t front) const;
  /// Gives a front to one rank.
  void set_owner(std::int32_t front, int rank) { owner_[front] = rank; }
  /// Gives a front to the ranks of another one.
  void share(std::int32_t front, std::int32_t as);
  /// Gives the same ranks of a shared front other fractions, which add up to one.
  void set_shares(std::int32_t front, std::vector<FrontShare> shares);

 private:
  int ranks_ = 1;
  double operations_weight_ = 1;
  std::vector<double> begin_;  // (fronts) of the interval of the subtree
  std::vector<double> end_;
  std::vector<int> owner_;
  std::vector<std::vector<FrontShare>> given_shares_;  // (fronts) by set_shares, or empty
};

/// What a mapping costs, counted tile by tile as the factorisation deals them (tile_map.hpp). Of update matrices and of sums that go from a
/// child to its parent the messages are bounds, one for each pair of ranks, and the bytes those of even shares.
struct MappingCounts {
  std::vector<double> operations;      // (ranks) of a factorisation
  std::vector<double> entries;         // (ranks) of L and D
  std::vector<double> messages;        // (ranks) received in a factorisation
  std::vector<double> bytes;           // (ranks) received in a factorisation
  std::vector<double> solve_messages;  // (ranks) received in a solve of up to 32 columns, there and back
  std::vector<double> solve_bytes;     // (ranks) the same for 16 columns
  double solve_path_messages = 0;      // one after the other on the longest way from a leaf to the root and back
  double total_operations = 0;
  double total_entries = 0;
  /// Operations on the longest chain of fronts and ranks, from the first pivot to the last, where a rank begins its share of a front as
  /// soon as it is free and the children are complete ...
  double path_operations = 0;
  /// ... and where all ranks of a front begin together and wait for the slowest.
  double gang_operations = 0;
  double shared_operations = 0;  // in fronts of more than one rank
  double shared_entries = 0;
  std::int32_t shared_fronts = 0;
  std::int32_t most_shared_fronts = 0;   // that one rank shares
  std::int32_t most_planned_fronts = 0;  // shared fronts that one rank has to know: those on its way to the root, and their children

  /// path_operations over total_operations / ranks: 1 is perfect.
  double path_ratio() const { return path_operations * static_cast<double>(operations.size()) / total_operations; }
  /// Entries of the fullest rank over the mean.
  double fullest_ratio() const;
};

MappingCounts count_mapping(const std::vector<FrontCost>& fronts, const Mapping& mapping);

/// The mapping of the shortest path, with some operations for each shared front on it, among several weights and grains whose fullest rank
/// has at most 1.25 times the mean of the entries; where none has, that of the fewest entries.
Mapping choose_mapping(const std::vector<FrontCost>& fronts, int ranks);

/// The shared fronts in the order in which their ranks are free and their children complete: children before parents. Where all ranks go
/// through it in this order, none waits for another that waits for it.
std::vector<std::int32_t> order_shared(const std::vector<FrontCost>& fronts, const Mapping& mapping);

}  // namespace carillon::ldlt
