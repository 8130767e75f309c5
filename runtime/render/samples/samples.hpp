// Strikes of a body as samples for any sampler: WAV files, and an SFZ file that says which key and velocity plays which.
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "runtime/scene/scene.hpp"

namespace carillon::samples {

/// What a key is: a place of the body (keys follow each other from `first_key`, mallet by mallet, and keep their pitch), or a pitch (one
/// instrument a mallet over the whole keyboard, transposed, whose places take turns).
enum class Keys { kPlaces, kPitches };
inline const std::vector<std::string> kKeysNames{"places", "pitches"};

struct SampleOptions {
  std::filesystem::path bank, folder;  // the folder is made, whole or not at all
  std::string name;                    // of the instrument's file; empty: the stem of the bank's
  std::size_t places = 4;              // bank::find_strikes(), unless points_m names them
  std::vector<Vec3> points_m{};
  int layers = 4;  // of velocity, as wide as each other
  std::vector<std::string> mallets{"hard-wood"};
  int round_robin = 1;     // strikes around each place that take turns
  double speed_m_s = 2.0;  // of the mallet at velocity 127; as the square of the velocity below
  Keys keys = Keys::kPlaces;
  int first_key = 36;
  int rate_hz = 48000;
  scene::SampleFormat format = scene::SampleFormat::kPcm24;
  double max_seconds = 6.0;  // of a sample; it ends where it is 80 dB below its peak
  std::function<void(double)> progress{};
};

struct SampleSet {
  std::vector<std::filesystem::path> instruments;  // the .sfz files
  std::size_t samples = 0;
  double bytes = 0.0;          // of the WAV files
  double full_scale_pa = 0.0;  // pressure at 1 m at full scale and velocity 127
  std::string warning;         // of strikes beyond the range of linear modes; empty: none
  double error_db = 0.0;       // mean over velocities: modes as played by their layer against those of the blow, A-weighted energy of the
                               // difference over that of the blow; what more layers make smaller
};

/// Strikes the body, fixed, with each mallet in each place at each speed, and writes the samples (1 m from its centre, mono) and the
/// instruments; the instruments last, so that what they name is there. Throws InputError for options out of range and for a bank that
/// cannot be struck, SystemError.
SampleSet make_samples(const SampleOptions& options);

}  // namespace carillon::samples
