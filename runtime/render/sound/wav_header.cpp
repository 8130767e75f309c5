// Source: Microsoft, Multimedia Programming Interface and Data Specifications 1.0 (1991); Microsoft, Multiple channel audio data and WAVE
//         files (2001) for the extensible header; EBU Tech 3306 (2009) for RF64.
#include "runtime/render/sound/wav_header.hpp"

#include <algorithm>
#include <string_view>

namespace carillon::sound {
namespace {

constexpr std::uint64_t kMax32 = 0xffffffffU;
constexpr unsigned kPcm = 1, kIeeeFloat = 3, kExtensible = 0xfffe;
/// KSDATAFORMAT_SUBTYPE of both behind its first two bytes, which are kPcm or kIeeeFloat.
constexpr std::string_view kSubtype("\x00\x00\x00\x00\x10\x00\x80\x00\x00\xaa\x00\x38\x9b\x71", 14);

/// Appends little-endian bytes.
void add(std::string& bytes, std::uint64_t value, int count) {
  for (int i = 0; i < count; ++i) bytes += static_cast<char>(value >> (8 * i) & 0xff);
}

}  // namespace

std::string make_wav_header(int rate_hz, std::size_t channels, SampleKind kind, std::uint64_t frames) {
  const std::uint64_t frame = channels * (kind.bits / 8), data = frames * frame;
  const unsigned tag = kind.is_float ? kIeeeFloat : kPcm;
  const bool is_extensible = channels > 2;
  std::string rest = "fmt ";
  add(rest, is_extensible ? 40 : 16, 4);
  add(rest, is_extensible ? kExtensible : tag, 2);
  add(rest, channels, 2);
  add(rest, static_cast<std::uint64_t>(rate_hz), 4);
  add(rest, static_cast<std::uint64_t>(rate_hz) * frame, 4);
  add(rest, frame, 2);
  add(rest, kind.bits, 2);
  if (is_extensible) {
    add(rest, 22, 2);         // bytes that follow
    add(rest, kind.bits, 2);  // valid ones
    add(rest, 0, 4);          // loudspeakers
    add(rest, tag, 2);
    rest += kSubtype;
  }
  if (kind.is_float) {
    rest += "fact";
    add(rest, 4, 4);
    add(rest, std::min(frames, kMax32), 4);
  }
  rest += "data";
  constexpr std::uint64_t kForm = 4, kSize = 4, kDs64 = 36;
  const std::uint64_t riff = kForm + rest.size() + kSize + data + data % 2;
  std::string header;
  if (riff <= kMax32) {
    header = "RIFF";
    add(header, riff, 4);
    header += "WAVE" + rest;
    add(header, data, 4);
  } else {
    header = "RF64";
    add(header, kMax32, 4);
    header += "WAVEds64";
    add(header, kDs64 - 8, 4);
    add(header, riff + kDs64, 8);
    add(header, data, 8);
    add(header, frames, 8);
    add(header, 0, 4);
    header += rest;
    add(header, kMax32, 4);
  }
  return header;
}

}  // namespace carillon::sound
