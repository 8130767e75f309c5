// Contents of a SOFA file.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace carillon::head {

inline constexpr std::size_t kMaxSamples = std::size_t{1} << 27U;  // total samples of the responses

/// Contents of a SimpleFreeFieldHRIR file; all numbers are finite, sizes agree.
struct SofaFile {
  double sample_rate_hz = 0.0;
  std::size_t measurements = 0, taps = 0;  // both above 0
  bool is_cartesian = false;
  std::vector<float> sources{};    // (measurements, 3): x, y, z [m], or azimuth, elevation [degrees] and distance [m]
  std::vector<float> responses{};  // (measurements, 2, taps), left ear first
  std::vector<float> delays{};     // [samples], (measurements, 2) or (2) or empty
};

/// Parses a file with libmysofa in a child process with limits on time and memory, because damaged files can crash libmysofa or keep it
/// busy forever. Throws InputError (message begins with `name`) for files that are not SimpleFreeFieldHRIR, damaged, or larger than
/// kMaxDirections and kMaxTaps; SystemError if no process can be created.
SofaFile parse_sofa(const std::string& bytes, const std::string& name);

}  // namespace carillon::head
