// A sum of doubles that has the same bits in any order and on any number of ranks.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "precompute/comm/communicator.hpp"

namespace carillon::transient {

/// Keeps the exact sum of the doubles added, as a whole number of the least double, in 67 digits of 32 bits (Kulisch 1971). Up to 2^30
/// values; with one that is not finite the sum is no number.
class OrderFreeSum {
 public:
  void add(double value);
  /// The sum, to the last bit or two, which bits do not depend on the order. Local.
  double calc() const;
  /// Each sum becomes that of all ranks. Collective.
  static void add_up(const comm::Communicator& comm, std::span<OrderFreeSum> sums);

 private:
  static constexpr std::size_t kDigits = 67;
  std::array<std::int64_t, kDigits + 1> digits_{};  // carries are not taken yet; the last counts values that are not finite
};

/// The sums over all ranks. Collective.
std::vector<double> calc_sums(const comm::Communicator& comm, std::span<OrderFreeSum> sums);
/// Of one. Collective.
double calc_sum(const comm::Communicator& comm, OrderFreeSum& sum);

}  // namespace carillon::transient
