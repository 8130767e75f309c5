// Method:     histogram of all groups by the logarithm of their bound, filled from the loud end until the room is used up: one pass, no
//             sorting. Removed modes do not return, so a single strike must not remove any: work beyond the ringing groups (strikes, woken
//             groups, fade-outs) accumulates a debt. Room = allowance of a block, minus the running mean of that work in proportion to the
//             debt (fully at four blocks' worth), minus an eighth of the debt beyond four blocks. The floor for strikes is the last
//             threshold, raised by a tenth per block while additional work exceeds half of the allowance beyond the first groups, and
//             lowered by half an octave per block when a tenth of the room is free.
// Source:     docs/decisions/budget.md.
#include "runtime/synth/budget.hpp"

#include <algorithm>
#include <bit>
#include <cstring>

#include "runtime/synth/kernels.hpp"

namespace carillon::synth {
namespace {

constexpr double kGroupCost = kGroup * kBlock;    // mode-samples of a ringing group per block
constexpr double kSmoothing = 0.125;              // running mean over eight blocks
constexpr double kRepayment = 0.125;              // of the debt per block
constexpr double kMaxDebt = 16.0, kCredit = 4.0;  // blocks
constexpr double kExtraShare = 0.5;
constexpr float kStricter = 1.1F, kMaxStrict = 1e6F;
constexpr double kReleaseBelow = 0.9;  // of the room
constexpr float kRelease = 0.7F;
constexpr float kInaudible = 1e-12F;  // Pa

std::int32_t to_bits(float x) noexcept {  // std::bit_cast is missing in the WebAssembly library
  std::int32_t bits;
  std::memcpy(&bits, &x, sizeof bits);
  return bits;
}
float from_bits(std::int32_t bits) noexcept {
  float x;
  std::memcpy(&x, &bits, sizeof x);
  return x;
}

}  // namespace

/// Exponent and leading mantissa bits: monotone for non-negative pressures.
int Budget::find_bin(float pressure_pa) noexcept {
  constexpr int kShift = 23 - std::bit_width(static_cast<unsigned>(kStepsPerOctave - 1));
  return std::clamp(to_bits(pressure_pa) >> kShift, 0, kBins - 1);
}

bool Budget::begin(double allowed, double spent, std::int64_t live_groups, int awake_bodies) noexcept {
  extra_ += kSmoothing * (std::max(0.0, spent - planned_) - extra_);
  debt_ = std::clamp(debt_ + spent - allowed_, 0.0, (kCredit + kMaxDebt) * allowed);
  allowed_ = allowed;
  const double overdrawn = std::max(0.0, debt_ - kCredit * allowed);
  const double base_cost = awake_bodies * kGroupCost;
  const bool strikes_take_too_much = extra_ > kExtraShare * std::max(0.0, allowed - base_cost) || overdrawn > 0.0;
  strictness_ = strikes_take_too_much ? std::min(strictness_ * kStricter, kMaxStrict) : std::max(1.0F, strictness_ / kStricter);
  const double predicted = allowed > 0.0 ? extra_ * std::min(1.0, debt_ / (kCredit * allowed)) : 0.0;
  const double room = std::max(0.0, allowed - predicted - kRepayment * overdrawn);
  planned_ = static_cast<double>(live_groups) * kGroupCost;  // fading groups cost one more block
  has_room_ = planned_ + extra_ < kReleaseBelow * allowed && debt_ < allowed;
  if (planned_ <= room) {
    if (planned_ < kReleaseBelow * room) threshold_pa_ *= kRelease;
    if (threshold_pa_ < kInaudible) threshold_pa_ = 0.0F;
    return false;
  }
  if (live_groups <= awake_bodies) {  // only first groups ring, which all stay
    threshold_pa_ *= kRelease;
    return false;
  }
  room_ = std::max<std::int64_t>(static_cast<std::int64_t>(room / kGroupCost) - awake_bodies, 0);
  count_.fill(0);
  return true;
}

void Budget::add(std::span<const float> bounds_pa) noexcept {
  for (std::size_t g = 1; g < bounds_pa.size(); ++g) ++count_[find_bin(bounds_pa[g])];
}

void Budget::decide() noexcept {
  last_room_ = room_;
  for (last_bin_ = kBins - 1; last_bin_ > 0 && count_[last_bin_] <= last_room_; --last_bin_) last_room_ -= count_[last_bin_];
  constexpr int kShift = 23 - std::bit_width(static_cast<unsigned>(kStepsPerOctave - 1));
  // If only first groups ring, keep the threshold low so that strikes may wake more.
  threshold_pa_ = std::max(kRelease * threshold_pa_, from_bits(last_bin_ << kShift));
}

int Budget::find_limit(std::span<const float> bounds_pa) noexcept {
  std::size_t stay = std::min<std::size_t>(1, bounds_pa.size());
  for (; stay < bounds_pa.size(); ++stay) {
    const int bin = find_bin(bounds_pa[stay]);
    if (bin < last_bin_ || (bin == last_bin_ && last_room_-- <= 0)) break;
  }
  return static_cast<int>(stay);
}

}  // namespace carillon::synth
