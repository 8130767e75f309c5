// WAV of the receivers.
#pragma once

#include <filesystem>
#include <vector>

namespace carillon::simulate {

/// channels: (receivers)(frames) [Pa]. 32-bit floats in pascals times `gain_per_pa`. Throws SystemError when the disk refuses.
void write_sound(const std::filesystem::path& file, const std::vector<std::vector<double>>& channels, int rate_hz, double gain_per_pa);

}  // namespace carillon::simulate
