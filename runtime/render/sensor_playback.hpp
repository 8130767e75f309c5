// Readings of a scene's sensors while it is rendered.
#pragma once

#include <cstdint>
#include <vector>

#include "runtime/bank/bank.hpp"
#include "runtime/render/sound/sound_store.hpp"
#include "runtime/scene/scene.hpp"
#include "runtime/synth/synthesiser.hpp"

namespace carillon::render {

/// Rate of the readings [Hz].
int find_sensor_rate(const scene::Scene& scene);

/// One channel per sensor of the scene, SI units in single precision; frame n is time n / rate.
class SensorPlayback {
 public:
  /// Adds the sensors to bodies that play nothing yet. Throws InputError that names the place in the scene.
  SensorPlayback(const scene::Scene& scene, const std::vector<const bank::Bank*>& banks, synth::Synthesiser& synthesiser,
                 std::uint64_t frames, sound::SoundStore& store);

  /// Appends the new samples of the sensors; call it at least every half second of sound.
  void take();
  /// True when all frames are in the store.
  bool is_complete() const { return store_->get_frames() >= frames_; }

 private:
  synth::Synthesiser* synthesiser_;
  std::uint64_t frames_;
  sound::SoundStore* store_;
  std::vector<int> numbers_;
  std::vector<double> samples_;
  std::vector<float> rows_;
};

}  // namespace carillon::render
