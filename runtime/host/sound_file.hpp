// WAV files.
#pragma once

#include <string>

#include "runtime/host/render.hpp"

namespace carillon::host {

/// The bytes of a WAV file, a channel for each of the sound: pressure times `gain_per_pa`, full scale 1. Throws SystemError when libsndfile
/// refuses.
std::string make_wav(const Sound& sound, double gain_per_pa, SampleFormat format);

}  // namespace carillon::host
