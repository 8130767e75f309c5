// Headers of WAV files.
#pragma once

#include <cstdint>
#include <string>

namespace carillon::sound {

struct SampleKind {
  unsigned bits = 24;
  bool is_float = false;
};

/// Header with lengths, so that the little-endian samples follow in one pass; an odd number of their bytes needs one more byte. Above 4 GiB
/// it is an RF64 (EBU Tech 3306), above two channels WAVE_FORMAT_EXTENSIBLE without loudspeakers: the channels are microphones.
std::string make_wav_header(int rate_hz, std::size_t channels, SampleKind kind, std::uint64_t frames);

}  // namespace carillon::sound
