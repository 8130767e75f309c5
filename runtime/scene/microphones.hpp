// Where a scene is heard.
#pragma once

#include <optional>
#include <vector>

#include "runtime/events/events.hpp"
#include "runtime/scene/scene.hpp"
#include "runtime/synth/listener.hpp"
#include "runtime/synth/trajectory.hpp"

namespace carillon::scene {

/// Places from something that moves: the listener's ears, one place for both without the effect two_ears, or the scene's microphones.
struct Microphones {
  synth::Trajectory centre;
  std::vector<Vec3> offset_m;  // a channel each
};

Microphones make_microphones(const Scene& scene);

/// The head in the middle of the listener's ears; nothing where they are free. Throws InputError, which begins with the file's name, for a
/// file that is no head's (head::read_sofa). Takes some milliseconds.
std::optional<synth::ListeningHead> make_head(const Scene& scene, double rate_hz);

/// The path of the centre from time 0 on, as events in order of time; none when it stays where it is.
std::vector<events::Listener> list_listener_path(const Microphones& microphones);

}  // namespace carillon::scene
