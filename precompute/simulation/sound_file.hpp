// WAV of the receivers, and its picture.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace carillon::simulation {

/// channels: (receivers)(frames) [Pa]. 32-bit floats in pascals times `gain_per_pa`. Throws SystemError when the disk refuses.
void write_sound(const std::filesystem::path& file, const std::vector<std::vector<double>>& channels, int rate_hz, double gain_per_pa);

/// The bytes of a PNG: sound::make_spectrogram_png() of the same channels. A long sound waits in `folder` meanwhile. Throws SystemError.
std::string draw_spectrogram(const std::vector<std::vector<double>>& channels, int rate_hz, const std::string& title,
                             const std::filesystem::path& folder);

}  // namespace carillon::simulation
