#include "runtime/scene/microphones.hpp"

#include <array>

#include "runtime/acoustics/head/sofa.hpp"
#include "runtime/acoustics/head/sphere.hpp"

namespace carillon::scene {

Microphones make_microphones(const Scene& scene) {
  if (!scene.microphones_m.empty()) return {synth::Trajectory(1), scene.microphones_m};
  const SceneListener& listener = scene.listener;
  std::vector<synth::PathPoint> path = listener.path;
  if (path.empty()) path.push_back({0.0, listener.position_m});
  Microphones microphones{synth::make_trajectory(path), {}};
  if (has_ambisonics(scene)) {
    microphones.offset_m.resize(count_channels(scene));
    return microphones;
  }
  for (Vec3 ear : calc_ears(listener)) {
    for (int k = 0; k < 3; ++k) ear[k] = scene.effects.has(synth::Effect::kTwoEars) ? ear[k] - listener.position_m[k] : 0.0;
    microphones.offset_m.push_back(ear);
  }
  return microphones;
}

std::optional<synth::ListeningHead> make_head(const Scene& scene, double rate_hz) {
  if (!has_head(scene)) return std::nullopt;
  const SceneListener& listener = scene.listener;
  const std::array<Vec3, 2> ears = calc_ears(listener);
  if (has_ambisonics(scene))
    return synth::ListeningHead{
        .head = nullptr, .rotation = synth::calc_head_rotation(listener.facing, ears[0] - ears[1]), .ambisonic_order = listener.order};
  return synth::ListeningHead{.head = listener.sofa.empty() ? head::make_sphere(rate_hz, {.radius_m = 0.5 * listener.ear_distance_m})
                                                            : head::read_sofa(listener.sofa, rate_hz),
                              .rotation = synth::calc_head_rotation(listener.facing, ears[0] - ears[1])};
}

std::vector<events::Listener> list_listener_path(const Microphones& microphones) {
  std::vector<events::Listener> path;
  if (microphones.centre.is_still()) return path;
  const auto add = [&path](const synth::Waypoint& at) {
    path.push_back({.time_s = at.time_s, .position_m = at.position_m, .velocity_m_s = at.velocity_m_s});
  };
  for (std::size_t i = 0; i < microphones.centre.get_count(); ++i) {
    const synth::Waypoint& at = microphones.centre.get_waypoint(i);
    if (at.time_s < 0.0) continue;
    if (path.empty()) add(microphones.centre.find(at.time_s));  // at rest before the path starts, or on the path
    add(at);
  }
  return path;
}

}  // namespace carillon::scene
