// Measured heads from SOFA files (AES69).
#pragma once

#include <filesystem>
#include <memory>

#include "runtime/acoustics/head/head.hpp"

namespace carillon::head {

inline constexpr int kMaxDirections = 20000;
inline constexpr double kMaxSpreadS = 0.005;  // between the delays of a head's responses; a head of a man makes 0.001

/// Whether this build reads SOFA files (CARILLON_SOFA).
bool has_sofa() noexcept;

/// Reads a file of the convention SimpleFreeFieldHRIR. Of several distances the farthest is taken. Responses are resampled to the rate,
/// shifted so that all begin together (at 0.15 of their peak), and cut where less than 1e-6 of their energy is left; their delays are kept
/// apart. Where the directions leave out a pole of the sphere by more than 15 degrees, the mean of the nearest ring stands there; between
/// three directions responses and delays are linear.
///
/// SOFA does not say what a level means. So the file as a whole is scaled until its mean power over directions and ears is that of a rigid
/// sphere of average size between 400 and 800 Hz, where heads differ by less than 1 dB. The delay of the origin is the mean of all delays.
///
/// Throws InputError, its message beginning with the file's name, where there is no file, it is no SOFA file of that convention, it holds
/// numbers that are not finite, more than kMaxDirections directions or more than kMaxTaps taps (as it is, or at the rate of playing), its
/// directions do not go round the head, its delays differ by more than kMaxSpreadS, or the build has no SOFA; also for a sample rate
/// outside kMinRateHz to kMaxRateHz. Not for an audio thread.
std::shared_ptr<const Head> read_sofa(const std::filesystem::path& file, double sample_rate_hz);

}  // namespace carillon::head
