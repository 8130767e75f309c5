#include "runtime/host/sound_file.hpp"

#include <fmt/format.h>
#include <sndfile.h>

#include <algorithm>
#include <cstring>
#include <memory>
#include <vector>

namespace carillon::host {
namespace {

/// A file in memory, for libsndfile.
struct Memory {
  std::string bytes;
  std::size_t at = 0;
};

sf_count_t get_length(void* user) { return static_cast<sf_count_t>(static_cast<Memory*>(user)->bytes.size()); }

sf_count_t seek(sf_count_t offset, int whence, void* user) {
  auto& memory = *static_cast<Memory*>(user);
  const auto base = static_cast<sf_count_t>(whence == SEEK_SET ? 0 : whence == SEEK_CUR ? memory.at : memory.bytes.size());
  if (base + offset < 0) return -1;
  memory.at = static_cast<std::size_t>(base + offset);
  return static_cast<sf_count_t>(memory.at);
}

sf_count_t read(void* data, sf_count_t count, void* user) {
  auto& memory = *static_cast<Memory*>(user);
  const std::size_t left = memory.at < memory.bytes.size() ? memory.bytes.size() - memory.at : 0;
  const std::size_t taken = std::min(left, static_cast<std::size_t>(count));
  std::memcpy(data, memory.bytes.data() + memory.at, taken);
  memory.at += taken;
  return static_cast<sf_count_t>(taken);
}

sf_count_t write(const void* data, sf_count_t count, void* user) {
  auto& memory = *static_cast<Memory*>(user);
  const auto size = static_cast<std::size_t>(count);
  if (memory.at + size > memory.bytes.size()) memory.bytes.resize(memory.at + size);
  std::memcpy(memory.bytes.data() + memory.at, data, size);
  memory.at += size;
  return count;
}

sf_count_t tell(void* user) { return static_cast<sf_count_t>(static_cast<Memory*>(user)->at); }

int get_subtype(SampleFormat format) {
  switch (format) {
    case SampleFormat::kPcm16:
      return SF_FORMAT_PCM_16;
    case SampleFormat::kPcm24:
      return SF_FORMAT_PCM_24;
    case SampleFormat::kPcm32:
      return SF_FORMAT_PCM_32;
    case SampleFormat::kFloat:
      return SF_FORMAT_FLOAT;
  }
  return SF_FORMAT_PCM_24;
}

}  // namespace

std::string make_wav(const Sound& sound, double gain_per_pa, SampleFormat format) {
  Memory memory;
  SF_VIRTUAL_IO io{get_length, seek, read, write, tell};
  SF_INFO info{};
  info.samplerate = sound.rate_hz;
  const std::size_t channels = sound.pressure_pa.size();
  info.channels = static_cast<int>(channels);
  info.format = SF_FORMAT_WAV | get_subtype(format);
  const auto close = [](SNDFILE* file) { sf_close(file); };
  std::unique_ptr<SNDFILE, decltype(close)> file(sf_open_virtual(&io, SFM_WRITE, &info, &memory), close);
  if (!file) throw SystemError(fmt::format("cannot make a WAV file: {}", sf_strerror(nullptr)));
  sf_command(file.get(), SFC_SET_ADD_PEAK_CHUNK, nullptr, SF_FALSE);  // it holds the hour: the same sound shall give the same bytes
  sf_command(file.get(), SFC_SET_CLIPPING, nullptr, SF_TRUE);         // a sample at full scale exactly must not wrap round
  const std::size_t samples = sound.pressure_pa[0].size();
  std::vector<double> frames;
  for (std::size_t start = 0; start < samples; start += 4096) {
    const std::size_t count = std::min<std::size_t>(4096, samples - start);
    frames.resize(channels * count);
    for (std::size_t n = 0; n < count; ++n) {
      for (std::size_t c = 0; c < channels; ++c) frames[channels * n + c] = sound.pressure_pa[c][start + n] * gain_per_pa;
    }
    if (sf_writef_double(file.get(), frames.data(), static_cast<sf_count_t>(count)) != static_cast<sf_count_t>(count)) {
      throw SystemError(fmt::format("cannot make a WAV file: {}", sf_strerror(file.get())));
    }
  }
  file.reset();
  return std::move(memory.bytes);
}

}  // namespace carillon::host
