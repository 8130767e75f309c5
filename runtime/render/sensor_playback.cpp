#include "runtime/render/sensor_playback.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <span>

#include "runtime/base/error.hpp"

namespace carillon::render {

int find_sensor_rate(const scene::Scene& scene) { return scene.sensor_rate_hz.value_or(scene.sample_rate_hz); }

SensorPlayback::SensorPlayback(const scene::Scene& scene, const std::vector<const bank::Bank*>& banks, synth::Synthesiser& synthesiser,
                               std::uint64_t frames, sound::SoundStore& store)
    : synthesiser_(&synthesiser), frames_(frames), store_(&store) {
  for (const scene::SceneSensor& sensor : scene.sensors) {
    const bank::Bank& bank = *banks[sensor.body];
    const synth::SensorSettings settings = scene::locate_sensor(scene, sensor, bank);
    try {
      numbers_.push_back(synthesiser.add_sensor(static_cast<int>(sensor.body), bank, settings));
    } catch (const InputError& error) {
      throw InputError(fmt::format("{}: {}", sensor.place, error.what()));
    }
  }
}

void SensorPlayback::take() {
  std::size_t ready = std::min<std::uint64_t>(frames_ - store_->get_frames(), std::numeric_limits<int>::max());
  for (const int number : numbers_) ready = std::min(ready, synthesiser_->find_sensor(number)->count_ready());
  samples_.resize(ready);
  rows_.resize(ready * numbers_.size());
  for (std::size_t c = 0; c < numbers_.size(); ++c) {
    synthesiser_->find_sensor(numbers_[c])->read(samples_);
    for (std::size_t n = 0; n < ready; ++n) rows_[n * numbers_.size() + c] = static_cast<float>(samples_[n]);
  }
  store_->append(rows_);
}

}  // namespace carillon::render
