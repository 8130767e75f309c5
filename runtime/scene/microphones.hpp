// Receivers of a scene.
#pragma once

#include <optional>
#include <vector>

#include "runtime/events/events.hpp"
#include "runtime/scene/scene.hpp"
#include "runtime/synth/listener.hpp"
#include "runtime/synth/trajectory.hpp"

namespace carillon::scene {

/// Offsets from a moving centre: the listener's ears (one point without the effect two_ears), or the scene's microphones.
struct Microphones {
  synth::Trajectory centre;
  std::vector<Vec3> offset_m;  // one per channel
};

Microphones make_microphones(const Scene& scene);

/// The head between the listener's ears, or Ambisonics; empty for free ears. Throws InputError "FILE: ..." for an invalid head file
/// (head::read_sofa). Takes some milliseconds.
std::optional<synth::ListeningHead> make_head(const Scene& scene, double rate_hz);

/// Path of the centre from time 0 on, as events in order of time; empty if it does not move.
std::vector<events::Listener> list_listener_path(const Microphones& microphones);

}  // namespace carillon::scene
