// Where a scene is heard.
#pragma once

#include <vector>

#include "runtime/host/scene.hpp"
#include "runtime/stream/events.hpp"
#include "runtime/synth/track.hpp"

namespace carillon::host {

/// Places from something that moves: the listener's ears, one place for both without the effect two_ears, or the scene's microphones.
struct Microphones {
  synth::Track centre;
  std::vector<Vec3> offset_m;  // a channel each
};

Microphones make_microphones(const Scene& scene);

/// The way of the centre from time 0 on, as events in order of time; none when it stays where it is.
std::vector<stream::Listener> list_walk(const Microphones& microphones);

}  // namespace carillon::host
