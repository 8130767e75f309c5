// Samples of a struck body for samplers: WAV files and SFZ instruments.
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "runtime/scene/scene.hpp"

namespace carillon::samples {

/// Meaning of a key: a place on the body (consecutive keys from `first_key`, mallet by mallet, untransposed), or a pitch (one instrument
/// per mallet over the whole keyboard, transposed; places alternate).
enum class Keys { kPlaces, kPitches };
inline const std::vector<std::string> kKeysNames{"places", "pitches"};

struct SampleOptions {
  std::filesystem::path bank, folder;  // the folder is created complete or not at all
  std::string name;                    // file name of the instrument; empty: stem of the bank's
  std::size_t places = 4;              // bank::find_strikes(), unless points_m is given
  std::vector<Vec3> points_m{};
  int layers = 4;  // velocity layers of equal width
  std::vector<std::string> mallets{"hard-wood"};
  int round_robin = 1;     // alternating strikes around each place
  double speed_m_s = 2.0;  // speed of the mallet at velocity 127; proportional to the square of the velocity
  Keys keys = Keys::kPlaces;
  int first_key = 36;
  int rate_hz = 48000;
  scene::SampleFormat format = scene::SampleFormat::kPcm24;
  double max_seconds = 6.0;  // maximum length of a sample; it ends 80 dB below its peak
  std::function<void(double)> progress{};
};

struct SampleSet {
  std::vector<std::filesystem::path> instruments;  // the .sfz files
  std::size_t samples = 0;
  double bytes = 0.0;          // WAV files
  double full_scale_pa = 0.0;  // pressure at 1 m at full scale and velocity 127
  std::string warning;         // strikes beyond the range of linear modes; empty: none
  double error_db = 0.0;  // A-weighted energy of the difference between layer and exact blow, relative to the blow, mean over velocities
};

/// Strikes the fixed body with each mallet at each place and speed, and writes the samples (mono, 1 m from its centre) and the instruments;
/// instruments last, so their samples exist. Throws InputError for options out of range and for a bank that cannot be struck, SystemError.
SampleSet make_samples(const SampleOptions& options);

}  // namespace carillon::samples
