#include "runtime/host/microphones.hpp"

namespace carillon::host {

Microphones make_microphones(const Scene& scene) {
  if (!scene.microphones_m.empty()) return {synth::Track(1), scene.microphones_m};
  const Listener& listener = scene.listener;
  std::vector<synth::Place> path = listener.path;
  if (path.empty()) path.push_back({0.0, listener.position_m});
  Microphones microphones{synth::make_track(path), {}};
  for (Vec3 ear : calc_ears(listener)) {
    for (int k = 0; k < 3; ++k) ear[k] = scene.effects.has(synth::Effect::kTwoEars) ? ear[k] - listener.position_m[k] : 0.0;
    microphones.offset_m.push_back(ear);
  }
  return microphones;
}

std::vector<stream::Listener> list_walk(const Microphones& microphones) {
  std::vector<stream::Listener> walk;
  if (microphones.centre.is_still()) return walk;
  const auto add = [&walk](const synth::Waypoint& at) {
    walk.push_back({.time_s = at.time_s, .position_m = at.position_m, .velocity_m_s = at.velocity_m_s});
  };
  for (std::size_t i = 0; i < microphones.centre.get_count(); ++i) {
    const synth::Waypoint& at = microphones.centre.get_waypoint(i);
    if (at.time_s < 0.0) continue;
    if (walk.empty()) add(microphones.centre.find(at.time_s));  // at rest until it sets out; or in the middle of its way
    add(at);
  }
  return walk;
}

}  // namespace carillon::host
