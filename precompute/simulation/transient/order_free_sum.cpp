// Method: every double is an integer multiple of 2^-1074; its bits are added to 32-bit digits in 64-bit words, and carries are propagated
//   at the end.
// Source: Kulisch 1971 (exact accumulator).
#include "precompute/simulation/transient/order_free_sum.hpp"

#include <bit>
#include <cmath>
#include <limits>

namespace carillon::transient {

void OrderFreeSum::add(double value) {
  const auto bits = std::bit_cast<std::uint64_t>(value);
  const auto exponent = static_cast<unsigned>((bits >> 52) & 0x7ff);
  if (exponent == 0x7ff) {
    ++digits_[kDigits];
    return;
  }
  std::uint64_t mantissa = bits & ((std::uint64_t{1} << 52) - 1);
  if (exponent > 0) mantissa |= std::uint64_t{1} << 52;
  const unsigned shift = exponent > 0 ? exponent - 1 : 0;
  const std::size_t digit = shift / 32;
  const std::uint64_t low = (mantissa & 0xffffffff) << (shift % 32), high = (mantissa >> 32) << (shift % 32);
  const std::int64_t sign = (bits >> 63) != 0 ? -1 : 1;
  digits_[digit] += sign * static_cast<std::int64_t>(low & 0xffffffff);
  digits_[digit + 1] += sign * static_cast<std::int64_t>((low >> 32) + (high & 0xffffffff));
  digits_[digit + 2] += sign * static_cast<std::int64_t>(high >> 32);
}

double OrderFreeSum::calc() const {
  if (digits_[kDigits] != 0) return std::numeric_limits<double>::quiet_NaN();
  auto carried = digits_;
  const auto carry = [&] {
    for (std::size_t i = 0; i + 1 < kDigits; ++i) {
      const std::int64_t over = carried[i] >> 32;
      carried[i] -= over * (std::int64_t{1} << 32);
      carried[i + 1] += over;
    }
  };
  carry();
  const bool negative = carried[kDigits - 1] < 0;
  if (negative) {
    for (std::int64_t& digit : carried) digit = -digit;
    carry();
  }
  double sum = 0.0;
  for (std::size_t i = kDigits; i-- > 0;) sum += std::ldexp(static_cast<double>(carried[i]), static_cast<int>(32 * i) - 1074);
  return negative ? -sum : sum;
}

void OrderFreeSum::add_up(const comm::Communicator& comm, std::span<OrderFreeSum> sums) {
  static_assert(sizeof(OrderFreeSum) == (kDigits + 1) * sizeof(std::int64_t));
  if (comm.size() == 1 || sums.empty()) return;
  comm.sum(std::span<std::int64_t>(sums.front().digits_.data(), sums.size() * (kDigits + 1)));
}

std::vector<double> calc_sums(const comm::Communicator& comm, std::span<OrderFreeSum> sums) {
  OrderFreeSum::add_up(comm, sums);
  std::vector<double> values;
  for (const OrderFreeSum& sum : sums) values.push_back(sum.calc());
  return values;
}

double calc_sum(const comm::Communicator& comm, OrderFreeSum& sum) {
  OrderFreeSum::add_up(comm, std::span(&sum, 1));
  return sum.calc();
}

}  // namespace carillon::transient
