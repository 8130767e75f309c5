// Shared by the checks: limits, and a bounded list of faults. Internal to carillon::bank.
#pragma once

#include <fmt/format.h>

#include <string>
#include <utility>
#include <vector>

#include "runtime/bank/bank.hpp"

namespace carillon::bank {

// Limits beyond all bodies. Length: a small planet. Frequency and damping: the maxima of a job, alpha1 of 1e6 s at that frequency.
inline constexpr double kMaxLengthM = 1e7, kMaxHz = 1e12, kMaxDecayPerS = 1e32;

/// Keeps the first three faults and counts the others.
class Faults {
 public:
  template <class... Values>
  void add(fmt::format_string<Values...> text, Values&&... values) {
    if (++count_ <= 3) reported_.push_back(fmt::format(text, std::forward<Values>(values)...));
  }
  bool empty() const { return count_ == 0; }
  std::vector<std::string> take() {
    if (count_ > 3) reported_.back() += fmt::format(" (and {} more)", count_ - 3);
    return std::move(reported_);
  }

 private:
  std::vector<std::string> reported_;
  std::size_t count_ = 0;
};

/// Fault of the multipoles' orders or number of coefficients; empty if none.
std::string find_order_fault(const Multipoles& multipoles);

/// Fault of the mixture's counts or indices; empty if none.
std::string find_mixing_fault(const Mixing& mixing);

/// Checks multipoles whose array sizes agree: part of the check "radiation".
Check check_multipoles(const Bank& bank);

/// Checks a nonlinear energy whose array sizes agree: numbers in range, elastic energy non-negative.
Check check_quartic(const Bank& bank);

/// Error bars must not be negative.
Check check_error_bars(const Bank& bank);

/// Proof of completeness, one check per part; a bank without one gets a single line and no fault.
std::vector<Check> check_proof(const Bank& bank);

}  // namespace carillon::bank
