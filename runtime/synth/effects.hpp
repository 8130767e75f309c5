// List of effects, and sets of them.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <optional>
#include <string_view>

namespace carillon::synth {

enum class Effect : std::uint8_t {
  kModal,
  kHertzPulse,
  kRoughness,
  kRolling,
  kContactDamping,
  kAccelerationNoise,
  kAirDelay,
  kDoppler,
  kTwoEars,
  kDirectivity,
  kGroundReflection,
  kHead,
  kNonlinear,
  kCascade
};
inline constexpr int kEffectCount = 14;

/// Name in scene files: "modal", "hertz_pulse", "roughness", "rolling", "contact_damping", "acceleration_noise", "air_delay", "doppler",
/// "two_ears", "directivity", "ground_reflection", "head", "nonlinear", "cascade".
const char* get_name(Effect effect) noexcept;
std::optional<Effect> find_effect(std::string_view name) noexcept;

/// Set of effects, one bit each. Bits beyond kEffectCount are 0.
class EffectSet {
 public:
  constexpr EffectSet() = default;
  constexpr EffectSet(std::initializer_list<Effect> effects) {
    for (const Effect effect : effects) bits_ = static_cast<std::uint16_t>(bits_ | bit(effect));
  }
  static constexpr EffectSet all() {
    EffectSet set;
    set.bits_ = (1U << kEffectCount) - 1;
    return set;
  }
  constexpr bool has(Effect effect) const { return (bits_ & bit(effect)) != 0; }
  constexpr bool has_any(EffectSet other) const { return (bits_ & other.bits_) != 0; }
  constexpr EffectSet with(Effect effect) const { return make(bits_ | bit(effect)); }
  constexpr EffectSet without(Effect effect) const { return make(bits_ & ~bit(effect)); }
  constexpr EffectSet with(EffectSet other) const { return make(bits_ | other.bits_); }
  constexpr EffectSet without(EffectSet other) const { return make(bits_ & ~other.bits_); }
  constexpr EffectSet common(EffectSet other) const { return make(bits_ & other.bits_); }
  constexpr bool is_empty() const { return bits_ == 0; }
  static constexpr EffectSet from_mask(unsigned mask) { return make(mask & all().bits_); }
  friend constexpr bool operator==(EffectSet, EffectSet) = default;

  /// Iterates in the order of enum Effect.
  class Iterator {
   public:
    using value_type = Effect;
    using difference_type = std::ptrdiff_t;
    constexpr Iterator() = default;
    constexpr explicit Iterator(unsigned left) : left_(left) {}
    constexpr Effect operator*() const { return static_cast<Effect>(std::countr_zero(left_)); }
    constexpr Iterator& operator++() {
      left_ &= left_ - 1;
      return *this;
    }
    constexpr Iterator operator++(int) {
      const Iterator before = *this;
      ++*this;
      return before;
    }
    friend constexpr bool operator==(Iterator, Iterator) = default;

   private:
    unsigned left_ = 0;  // remaining bits
  };
  constexpr Iterator begin() const { return Iterator(bits_); }
  constexpr Iterator end() const { return Iterator(); }

 private:
  static constexpr unsigned bit(Effect effect) { return 1U << static_cast<unsigned>(effect); }
  static constexpr EffectSet make(unsigned bits) {
    EffectSet set;
    set.bits_ = static_cast<std::uint16_t>(bits);
    return set;
  }
  std::uint16_t bits_ = 0;
};

/// Effects of lasting contacts.
inline constexpr EffectSet kContactEffects{Effect::kRoughness, Effect::kRolling, Effect::kContactDamping};

/// Modes, finite pulses, travel time, Doppler shift, one receiver per microphone.
inline constexpr EffectSet kDefaultEffects{Effect::kModal, Effect::kHertzPulse, Effect::kAirDelay, Effect::kDoppler, Effect::kTwoEars};

/// One value per effect.
template <typename T>
class PerEffect {
 public:
  constexpr T& operator[](Effect effect) { return values_[static_cast<std::size_t>(effect)]; }
  constexpr const T& operator[](Effect effect) const { return values_[static_cast<std::size_t>(effect)]; }
  constexpr void fill(const T& value) { values_.fill(value); }
  constexpr auto begin() const { return values_.begin(); }
  constexpr auto end() const { return values_.end(); }
  friend constexpr bool operator==(const PerEffect&, const PerEffect&) = default;

 private:
  std::array<T, kEffectCount> values_{};
};

}  // namespace carillon::synth
