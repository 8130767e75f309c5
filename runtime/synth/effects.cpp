#include "runtime/synth/effects.hpp"

#include <array>

namespace carillon::synth {
namespace {

constexpr std::array<const char*, kEffectCount> kNames{
    "modal",     "hertz_pulse", "roughness", "rolling",     "contact_damping",   "acceleration_noise",
    "air_delay", "doppler",     "two_ears",  "directivity", "ground_reflection", "head",
    "nonlinear", "cascade"};

}  // namespace

const char* get_name(Effect effect) noexcept { return kNames[static_cast<std::size_t>(effect)]; }

std::optional<Effect> find_effect(std::string_view name) noexcept {
  for (std::size_t i = 0; i < kNames.size(); ++i) {
    if (name == kNames[i]) return static_cast<Effect>(i);
  }
  return std::nullopt;
}

}  // namespace carillon::synth
