// The size to which the modes of a scaled node belong. KHR_audio_rigid_bodies, draft of 2026-08: the text says the node's initial size, the
// published samples are of the unscaled geometry. docs/decisions/exchange.md.
#pragma once

#include <optional>
#include <string>

namespace carillon::exchange {

struct ScaleFacts {
  double scale = 1.0;
  std::optional<double> model_kg{};       // massProperties.mass
  std::optional<double> body_kg{};        // motion.mass
  std::optional<double> density_kg_m3{};  // of the model's material
  double volume_m3 = 0.0;                 // of the sample surface as stored
  double lowest_hz = 0.0;                 // as stored, for messages
  std::optional<bool> is_unscaled{};      // --scale-frequencies
};

struct ScaleChoice {
  bool is_unscaled = false;  // modes and masses of the model are those of the unscaled geometry
  bool is_sure = true;       // false: a guess, for a warning
  std::string reason;        // empty for a node without scale
};

/// The masses decide; without those of the body, the density.
ScaleChoice choose_scale(const ScaleFacts& facts);

}  // namespace carillon::exchange
