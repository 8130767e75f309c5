// Where a scene is heard.
#pragma once

#include <vector>

#include "runtime/host/scene.hpp"
#include "runtime/synth/track.hpp"

namespace carillon::host {

/// Places from something that moves: the listener's ears, one place for both without the effect two_ears, or the scene's microphones.
struct Microphones {
  synth::Track centre;
  std::vector<Vec3> offset_m;  // a channel each
};

Microphones make_microphones(const Scene& scene);

}  // namespace carillon::host
