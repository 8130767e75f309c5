// Measured heads from SOFA files (AES69).
#pragma once

#include <filesystem>
#include <memory>

#include "runtime/acoustics/head/head.hpp"

namespace carillon::head {

inline constexpr int kMaxDirections = 20000;
inline constexpr double kMaxSpreadS = 0.005;  // between the delays of a head's responses; about 0.001 for a human head

/// True if this build reads SOFA files (CARILLON_SOFA).
bool has_sofa() noexcept;

/// Reads a SimpleFreeFieldHRIR file. Of several distances the farthest is used. Responses are resampled to the rate, aligned to a common
/// onset (0.15 of their peak), and truncated where less than 1e-6 of their energy is left; their delays are stored separately. If the
/// directions leave out a pole of the sphere by more than 15 degrees, the mean of the nearest ring is used there; between three directions
/// responses and delays are interpolated linearly.
///
/// SOFA does not define absolute levels: the file is scaled so that its mean power over directions and ears equals that of a rigid sphere
/// of average size between 400 and 800 Hz, where heads differ by less than 1 dB. The delay of the origin is the mean of all delays.
///
/// Throws InputError (message begins with the file's name) for a missing file, another format or convention, non-finite numbers, more than
/// kMaxDirections directions or kMaxTaps taps (before or after resampling), directions that do not surround the head, delays that differ by
/// more than kMaxSpreadS, a build without SOFA, and a sample rate outside kMinRateHz to kMaxRateHz. Not for an audio thread.
std::shared_ptr<const Head> read_sofa(const std::filesystem::path& file, double sample_rate_hz);

}  // namespace carillon::head
