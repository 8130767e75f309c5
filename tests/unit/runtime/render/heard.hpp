// Sounds of scenes with all samples.
#pragma once

#include <vector>

#include "runtime/render/render.hpp"

namespace carillon::render {

/// A sound with all samples by channel.
struct Heard : Sound {
  std::vector<std::vector<double>> pressure_pa;
};

inline Heard read_all(const Sound& sound, const sound::SoundStore& store) {
  Heard heard{sound, {}};
  heard.pressure_pa.resize(store.get_channels());
  store.for_each_piece([&](std::uint64_t, std::span<const float> frames) {
    for (std::size_t i = 0; i < frames.size(); ++i) heard.pressure_pa[i % store.get_channels()].push_back(static_cast<double>(frames[i]));
  });
  return heard;
}

inline Heard calc_sound(const scene::Scene& scene, const std::vector<const bank::Bank*>& banks, const std::vector<events::Event>& events,
                        const RenderOptions& options) {
  sound::SoundStore store(options.rate_hz, scene::count_channels(scene));
  const Sound sound = render::calc_sound(scene, banks, scene::make_events(events), options, store);
  return read_all(sound, store);
}

}  // namespace carillon::render
