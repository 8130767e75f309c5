// The numbers of a SOFA file.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace carillon::head {

inline constexpr std::size_t kMaxSamples = std::size_t{1} << 27U;  // of all responses

/// What a file of SimpleFreeFieldHRIR holds; all finite, and as many as the sizes say.
struct SofaFile {
  double sample_rate_hz = 0.0;
  std::size_t measurements = 0, taps = 0;  // both above 0
  bool is_cartesian = false;
  std::vector<float> sources{};    // (measurements, 3): x, y, z [m], or azimuth, elevation [degrees] and distance [m]
  std::vector<float> responses{};  // (measurements, 2, taps), left ear first
  std::vector<float> delays{};     // [samples], (measurements, 2) or (2) or empty
};

/// Reads the bytes of a file by libmysofa, in a process of its own with bounds on its time and memory: damaged files can crash libmysofa or
/// keep it busy for ever, and here that is an error like any other. Throws InputError, its message beginning with `name`, for what is no
/// such file, is damaged, or is larger than kMaxDirections and kMaxTaps allow; SystemError where no process can be made.
SofaFile parse_sofa(const std::string& bytes, const std::string& name);

}  // namespace carillon::head
