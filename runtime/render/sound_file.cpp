// Method: the header is written here because libsndfile needs a seekable file for its own; the samples come from libsndfile, headerless.
// Source: Microsoft, Multimedia Programming Interface and Data Specifications 1.0 (1991); EBU Tech 3306 (2009) for RF64.
#include "runtime/render/sound_file.hpp"

#include <fmt/format.h>
#include <sndfile.h>

#include <exception>
#include <memory>
#include <vector>

namespace carillon::render {
namespace {

constexpr std::uint64_t kMax32 = 0xffffffffU;

struct Encoding {
  int subtype;  // libsndfile's code
  unsigned tag, bits;
};

Encoding get_encoding(scene::SampleFormat format) {
  switch (format) {
    case scene::SampleFormat::kPcm16:
      return {SF_FORMAT_PCM_16, 1, 16};
    case scene::SampleFormat::kPcm24:
      return {SF_FORMAT_PCM_24, 1, 24};
    case scene::SampleFormat::kPcm32:
      return {SF_FORMAT_PCM_32, 1, 32};
    case scene::SampleFormat::kFloat:
      return {SF_FORMAT_FLOAT, 3, 32};
  }
  return {SF_FORMAT_PCM_24, 1, 24};
}

/// Appends little-endian bytes.
void add(std::string& bytes, std::uint64_t value, int count) {
  for (int i = 0; i < count; ++i) bytes += static_cast<char>(value >> (8 * i) & 0xff);
}

std::uint64_t calc_data_bytes(std::size_t channels, scene::SampleFormat format, std::uint64_t frames) {
  return frames * channels * (get_encoding(format).bits / 8);
}

/// Forwards libsndfile's output to the sink; exceptions are stored and rethrown outside C code.
struct Passage {
  const std::function<void(std::string_view)>* sink = nullptr;
  sf_count_t at = 0;
  std::exception_ptr failure = nullptr;
};

sf_count_t get_length(void* user) { return static_cast<Passage*>(user)->at; }
sf_count_t seek(sf_count_t, int, void* user) { return static_cast<Passage*>(user)->at; }
sf_count_t read(void*, sf_count_t, void*) { return 0; }
sf_count_t get_position(void* user) { return static_cast<Passage*>(user)->at; }

sf_count_t write(const void* data, sf_count_t count, void* user) {
  auto& passage = *static_cast<Passage*>(user);
  try {
    (*passage.sink)({static_cast<const char*>(data), static_cast<std::size_t>(count)});
  } catch (...) {
    passage.failure = std::current_exception();
    return 0;
  }
  passage.at += count;
  return count;
}

}  // namespace

std::string make_wav_header(int rate_hz, std::size_t channels, scene::SampleFormat format, std::uint64_t frames) {
  const Encoding encoding = get_encoding(format);
  const std::uint64_t data = calc_data_bytes(channels, format, frames), frame = channels * (encoding.bits / 8);
  std::string rest = "fmt ";
  add(rest, 16, 4);
  add(rest, encoding.tag, 2);
  add(rest, channels, 2);
  add(rest, static_cast<std::uint64_t>(rate_hz), 4);
  add(rest, static_cast<std::uint64_t>(rate_hz) * frame, 4);
  add(rest, frame, 2);
  add(rest, encoding.bits, 2);
  if (encoding.tag == 3) {
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

std::uint64_t calc_wav_bytes(std::size_t channels, scene::SampleFormat format, std::uint64_t frames) {
  const std::uint64_t data = calc_data_bytes(channels, format, frames);
  return make_wav_header(1, channels, format, frames).size() + data + data % 2;
}

void write_wav(const sound::SoundStore& sound, double gain_per_pa, scene::SampleFormat format,
               const std::function<void(std::string_view)>& sink) {
  sink(make_wav_header(sound.get_rate_hz(), sound.get_channels(), format, sound.get_frames()));
  Passage passage{.sink = &sink};
  SF_VIRTUAL_IO io{get_length, seek, read, write, get_position};
  SF_INFO info{};
  info.samplerate = sound.get_rate_hz();
  info.channels = static_cast<int>(sound.get_channels());
  info.format = SF_FORMAT_RAW | SF_ENDIAN_LITTLE | get_encoding(format).subtype;
  const auto close = [](SNDFILE* file) { sf_close(file); };
  std::unique_ptr<SNDFILE, decltype(close)> file(sf_open_virtual(&io, SFM_WRITE, &info, &passage), close);
  if (!file) throw SystemError(fmt::format("cannot make a WAV file: {}", sf_strerror(nullptr)));
  sf_command(file.get(), SFC_SET_CLIPPING, nullptr, SF_TRUE);  // clips instead of wrapping at full scale
  std::vector<double> scaled;
  sound.for_each_piece([&](std::uint64_t, std::span<const float> frames) {
    scaled.resize(frames.size());
    for (std::size_t i = 0; i < frames.size(); ++i) scaled[i] = static_cast<double>(frames[i]) * gain_per_pa;
    const auto count = static_cast<sf_count_t>(scaled.size());
    const sf_count_t put = sf_write_double(file.get(), scaled.data(), count);
    if (passage.failure) std::rethrow_exception(passage.failure);
    if (put != count) throw SystemError(fmt::format("cannot make a WAV file: {}", sf_strerror(file.get())));
  });
  file.reset();
  if (passage.failure) std::rethrow_exception(passage.failure);
  if (calc_data_bytes(sound.get_channels(), format, sound.get_frames()) % 2 != 0) sink(std::string_view("\0", 1));
}

}  // namespace carillon::render
