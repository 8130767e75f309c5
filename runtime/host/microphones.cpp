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

}  // namespace carillon::host
