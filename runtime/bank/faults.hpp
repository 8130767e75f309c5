// What checks share: bounds that no body reaches, and a list of faults that stays short. Internal to carillon::bank.
#pragma once

#include <fmt/format.h>

#include <string>
#include <utility>
#include <vector>

#include "runtime/bank/bank.hpp"

namespace carillon::bank {

// Bounds that no body reaches. Length: a small planet. Frequency and damping: what a job may ask for at most, alpha1 of 1e6 s at that
// frequency.
inline constexpr double kMaxLengthM = 1e7, kMaxHz = 1e12, kMaxDecayPerS = 1e32;

/// The first three faults in full, the others counted.
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

/// What is wrong with the orders of multipoles or the number of their coefficients; empty when nothing is.
std::string find_order_fault(const Multipoles& multipoles);

/// What is wrong with the counts and numbers of a mixture; empty when nothing is.
std::string find_mixing_fault(const Mixing& mixing);

/// Multipoles whose array sizes agree: a part of the check "radiation".
Check check_multipoles(const Bank& bank);

/// A nonlinear energy whose array sizes agree: none of its numbers is out of range, and the elastic energy is never negative.
Check check_quartic(const Bank& bank);

/// Error bars: none is negative.
Check check_error_bars(const Bank& bank);

/// The proof that the band is complete, one check for each of its parts; a bank without one gets a single line that says so, and no fault.
std::vector<Check> check_proof(const Bank& bank);

}  // namespace carillon::bank
