// WAV of the receivers, and its spectrogram.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace carillon::simulation {

/// channels: (receivers)(frames) [Pa]. 32-bit floats in pascals times `gain_per_pa`. Throws SystemError for write errors.
void write_sound(const std::filesystem::path& file, const std::vector<std::vector<double>>& channels, int rate_hz, double gain_per_pa);

/// PNG bytes of sound::make_spectrogram_png() of the same channels. Long sounds are buffered in `folder`. Throws SystemError.
std::string draw_spectrogram(const std::vector<std::vector<double>>& channels, int rate_hz, const std::string& title,
                             const std::filesystem::path& folder);

}  // namespace carillon::simulation
