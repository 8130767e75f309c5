// Sum of doubles, bit-identical in any order and on any number of ranks.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "precompute/comm/communicator.hpp"

namespace carillon::transient {

/// Exact sum of doubles as an integer multiple of the smallest double, in 67 digits of 32 bits (Kulisch 1971). Up to 2^30 values; NaN if
/// any is not finite.
class OrderFreeSum {
 public:
  void add(double value);
  /// The sum, accurate to the last bit or two, independent of the order. Local.
  double calc() const;
  /// Replaces each sum by the sum over all ranks. Collective.
  static void add_up(const comm::Communicator& comm, std::span<OrderFreeSum> sums);

 private:
  static constexpr std::size_t kDigits = 67;
  std::array<std::int64_t, kDigits + 1> digits_{};  // carries pending; the last counts non-finite values
};

/// Sums over all ranks. Collective.
std::vector<double> calc_sums(const comm::Communicator& comm, std::span<OrderFreeSum> sums);
/// A single sum. Collective.
double calc_sum(const comm::Communicator& comm, OrderFreeSum& sum);

}  // namespace carillon::transient
