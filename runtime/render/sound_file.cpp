// Method: samples and codecs are libsndfile's. Integers are rounded here, so that all codecs without loss get the same. The header of WAV
//         is our own, because libsndfile needs a seekable file for it, and standard output is none.
#include "runtime/render/sound_file.hpp"

#include <fmt/format.h>
#include <sndfile.h>

#include <algorithm>
#include <cmath>
#include <exception>
#include <memory>
#include <vector>

#include "runtime/base/error.hpp"

namespace carillon::render {
namespace {

constexpr std::size_t kMaxFlacChannels = 8;
/// More channels are loudspeakers in Opus and Vorbis: coded together, one of them without treble.
constexpr std::size_t kMaxLossyChannels = 2;
constexpr int kMaxPlainFlacHz = 65535;  // above, only multiples of 10 Hz

int get_subtype(scene::SampleFormat format) {
  switch (format) {
    case scene::SampleFormat::kPcm16:
      return SF_FORMAT_PCM_16;
    case scene::SampleFormat::kPcm24:
      return SF_FORMAT_PCM_24;
    case scene::SampleFormat::kPcm32:
      return SF_FORMAT_PCM_32;
    case scene::SampleFormat::kFloat:
      return SF_FORMAT_FLOAT;
  }
  return SF_FORMAT_PCM_24;
}

int get_code(SoundCodec codec, scene::SampleFormat format) {
  switch (codec) {
    case SoundCodec::kWav:
      return SF_FORMAT_RAW | SF_ENDIAN_LITTLE | get_subtype(format);
    case SoundCodec::kFlac:
      return SF_FORMAT_FLAC | get_subtype(format);
    case SoundCodec::kOpus:
      return SF_FORMAT_OGG | SF_FORMAT_OPUS;
    case SoundCodec::kVorbis:
      return SF_FORMAT_OGG | SF_FORMAT_VORBIS;
  }
  return 0;
}

std::uint64_t calc_data_bytes(std::size_t channels, scene::SampleFormat format, std::uint64_t frames) {
  return frames * channels * (get_sample_kind(format).bits / 8);
}

/// Where libsndfile writes: at(offset, bytes). Exceptions are stored and rethrown outside C code.
struct Passage {
  std::function<void(sf_count_t, std::string_view)> put;
  sf_count_t at = 0, length = 0;
  std::exception_ptr failure = nullptr;
};

sf_count_t get_length(void* user) { return static_cast<Passage*>(user)->length; }
sf_count_t read(void*, sf_count_t, void*) { return 0; }
sf_count_t get_position(void* user) { return static_cast<Passage*>(user)->at; }

sf_count_t seek(sf_count_t offset, int whence, void* user) {
  auto& passage = *static_cast<Passage*>(user);
  passage.at = offset + (whence == SEEK_SET ? 0 : whence == SEEK_CUR ? passage.at : passage.length);
  return passage.at;
}

sf_count_t write(const void* data, sf_count_t count, void* user) {
  auto& passage = *static_cast<Passage*>(user);
  try {
    passage.put(passage.at, {static_cast<const char*>(data), static_cast<std::size_t>(count)});
  } catch (...) {
    passage.failure = std::current_exception();
    return 0;
  }
  passage.at += count;
  passage.length = std::max(passage.length, passage.at);
  return count;
}

/// Clips instead of wrapping at full scale.
int round_sample(double share) {
  constexpr double kFull = 0x1p31;
  return static_cast<int>(std::lrint(std::clamp(share * kFull, -kFull, kFull - 1.0)));
}

void encode(const sound::SoundStore& sound, double gain_per_pa, int code, bool has_integers, Passage& passage) {
  SF_VIRTUAL_IO io{get_length, seek, read, write, get_position};
  SF_INFO info{};
  info.samplerate = sound.get_rate_hz();
  info.channels = static_cast<int>(sound.get_channels());
  info.format = code;
  const auto close = [](SNDFILE* file) { sf_close(file); };
  std::unique_ptr<SNDFILE, decltype(close)> file(sf_open_virtual(&io, SFM_WRITE, &info, &passage), close);
  const auto check = [&passage](bool is_good, SNDFILE* of) {
    if (passage.failure) std::rethrow_exception(passage.failure);
    if (!is_good) throw SystemError(fmt::format("cannot make a sound file: {}", sf_strerror(of)));
  };
  check(file != nullptr, nullptr);
  std::vector<double> scaled;
  std::vector<int> rounded;
  sound.for_each_piece([&](std::uint64_t, std::span<const float> frames) {
    const auto count = static_cast<sf_count_t>(frames.size());
    scaled.clear();
    for (const float p : frames) scaled.push_back(static_cast<double>(p) * gain_per_pa);
    if (has_integers) {
      rounded.clear();
      for (const double share : scaled) rounded.push_back(round_sample(share));
      check(sf_write_int(file.get(), rounded.data(), count) == count, file.get());
    } else {
      check(sf_write_double(file.get(), scaled.data(), count) == count, file.get());
    }
  });
  file.reset();
  check(true, nullptr);
}

}  // namespace

SoundCodec find_codec(const std::filesystem::path& file, int rate_hz, std::size_t channels, scene::SampleFormat format, bool has_format) {
  const auto refuse = [&](const std::string& why) { throw InputError(fmt::format("{}: {}", file.string(), why)); };
  const std::string extension = base::find_extension(file);
  if (file == "-" || extension == ".wav" || extension == ".wave") return SoundCodec::kWav;
  if (extension == ".flac") {
    if (format == scene::SampleFormat::kPcm32 || format == scene::SampleFormat::kFloat)
      refuse("FLAC has samples of 16 or 24 bits; give --format pcm24, or write a .wav");
    if (channels > kMaxFlacChannels)
      refuse(fmt::format("FLAC has at most {} channels, and the sound has {}; write a .wav", kMaxFlacChannels, channels));
    if (rate_hz > kMaxPlainFlacHz && rate_hz % 10 != 0)
      refuse(fmt::format("FLAC has no {} Hz: above {} Hz a rate must be a multiple of 10; give another --rate, or write a .wav", rate_hz,
                         kMaxPlainFlacHz));
    return SoundCodec::kFlac;
  }
  if (extension != ".opus" && extension != ".ogg")
    refuse("the sound is written as WAV, FLAC, Opus or Vorbis; give the output a name that ends in .wav, .flac, .opus or .ogg");
  if (channels > kMaxLossyChannels)
    refuse(fmt::format("{} takes one or two channels, and the sound has {}; write a .flac or a .wav", extension, channels));
  if (has_format) refuse(fmt::format("{} has no sample format; leave --format out, or write a .flac or a .wav", extension));
  if (extension == ".ogg") return SoundCodec::kVorbis;
  if (rate_hz != 8000 && rate_hz != 12000 && rate_hz != 16000 && rate_hz != 24000 && rate_hz != 48000)
    refuse(fmt::format("Opus has 8000, 12000, 16000, 24000 and 48000 Hz, not {}; give --rate 48000, or write a .flac", rate_hz));
  return SoundCodec::kOpus;
}

sound::SampleKind get_sample_kind(scene::SampleFormat format) {
  constexpr sound::SampleKind kKinds[] = {{16, false}, {24, false}, {32, false}, {32, true}};
  return kKinds[static_cast<std::size_t>(format)];
}

std::uint64_t calc_wav_bytes(std::size_t channels, scene::SampleFormat format, std::uint64_t frames) {
  const std::uint64_t data = calc_data_bytes(channels, format, frames);
  return sound::make_wav_header(1, channels, get_sample_kind(format), frames).size() + data + data % 2;
}

void write_wav(const sound::SoundStore& sound, double gain_per_pa, scene::SampleFormat format,
               const std::function<void(std::string_view)>& sink) {
  sink(sound::make_wav_header(sound.get_rate_hz(), sound.get_channels(), get_sample_kind(format), sound.get_frames()));
  Passage passage{.put = [&sink](sf_count_t, std::string_view bytes) { sink(bytes); }};
  encode(sound, gain_per_pa, get_code(SoundCodec::kWav, format), format != scene::SampleFormat::kFloat, passage);
  if (calc_data_bytes(sound.get_channels(), format, sound.get_frames()) % 2 != 0) sink(std::string_view("\0", 1));
}

void write_coded(const sound::SoundStore& sound, double gain_per_pa, scene::SampleFormat format, SoundCodec codec, base::WholeFile& file) {
  Passage passage;
  passage.put = [&](sf_count_t at, std::string_view bytes) {
    if (at == passage.length)
      file.append(bytes);
    else
      file.overwrite(static_cast<std::uint64_t>(at), bytes);  // of FLAC: lengths and checksum in its first block
  };
  encode(sound, gain_per_pa, get_code(codec, format), codec == SoundCodec::kFlac, passage);
}

}  // namespace carillon::render
