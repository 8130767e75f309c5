// The effects that a scene may call for: the one list of them.
#pragma once

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
  kTwoEars
};
inline constexpr int kEffectCount = 9;

/// As scene files call it: "modal", "hertz_pulse", "roughness", "rolling", "contact_damping", "acceleration_noise", "air_delay", "doppler",
/// "two_ears".
const char* get_name(Effect effect) noexcept;
std::optional<Effect> find_effect(std::string_view name) noexcept;

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
  constexpr EffectSet with(Effect effect) const { return make(bits_ | bit(effect)); }
  constexpr EffectSet without(Effect effect) const { return make(bits_ & ~bit(effect)); }
  constexpr EffectSet with(EffectSet other) const { return make(bits_ | other.bits_); }
  constexpr EffectSet without(EffectSet other) const { return make(bits_ & ~other.bits_); }
  friend constexpr bool operator==(EffectSet, EffectSet) = default;

 private:
  static constexpr unsigned bit(Effect effect) { return 1U << static_cast<unsigned>(effect); }
  static constexpr EffectSet make(unsigned bits) {
    EffectSet set;
    set.bits_ = static_cast<std::uint16_t>(bits);
    return set;
  }
  std::uint16_t bits_ = 0;
};

}  // namespace carillon::synth
