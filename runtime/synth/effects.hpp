// The effects that a scene may call for: the one list of them.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <optional>
#include <string_view>

// The effects of this build, bit i for effect i; the CMake option CARILLON_EFFECTS gives it.
#ifndef CARILLON_EFFECTS_MASK
#define CARILLON_EFFECTS_MASK 0x3fff
#endif

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

/// As scene files call it: "modal", "hertz_pulse", "roughness", "rolling", "contact_damping", "acceleration_noise", "air_delay", "doppler",
/// "two_ears", "directivity", "ground_reflection", "head", "nonlinear", "cascade".
const char* get_name(Effect effect) noexcept;
std::optional<Effect> find_effect(std::string_view name) noexcept;

/// A set of effects, one bit each. Bits beyond kEffectCount are 0, so that equal sets have equal bits.
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

  /// Goes through the effects of the set in the order of their list.
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
    unsigned left_ = 0;  // bits of those that are still to come
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

/// What this build can play. Code of other effects is not in it.
inline constexpr EffectSet kCompiledEffects = EffectSet::from_mask(CARILLON_EFFECTS_MASK);
/// Whether this build and a set have an effect: false without a look at the set where the build has not.
constexpr bool has(EffectSet effects, Effect effect) { return kCompiledEffects.has(effect) && effects.has(effect); }

/// What contacts that last make of the surfaces that touch.
inline constexpr EffectSet kContactEffects{Effect::kRoughness, Effect::kRolling, Effect::kContactDamping};

/// Default effects: a body rings, struck by pulses that last, heard late, with Doppler shift, by every microphone at
/// its own place.
inline constexpr EffectSet kDefaultEffects =
    EffectSet{Effect::kModal, Effect::kHertzPulse, Effect::kAirDelay, Effect::kDoppler, Effect::kTwoEars}.common(kCompiledEffects);

/// Throws InputError that names the first effect of `effects` that this build was made without. [main-thread]
void check_compiled(EffectSet effects);

/// One value for each effect.
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
