#include "precompute/simulation/sound_file.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <bit>
#include <cstdint>
#include <cstring>
#include <string>

#include "runtime/base/error.hpp"
#include "runtime/base/file.hpp"
#include "runtime/render/sound/sound_store.hpp"
#include "runtime/render/sound/spectrogram.hpp"

namespace carillon::simulation {
namespace {

static_assert(std::endian::native == std::endian::little);

template <typename T>
void put(std::string& bytes, T value) {
  bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
}

}  // namespace

void write_sound(const std::filesystem::path& file, const std::vector<std::vector<double>>& channels, int rate_hz, double gain_per_pa) {
  const std::size_t frames = channels.empty() ? 0 : channels[0].size();
  const std::uint64_t data = std::uint64_t{frames} * channels.size() * sizeof(float);
  if (data > 0xfffff000ULL)
    throw InputError(fmt::format("{}: {} channels of {} samples are more than a WAV file can hold; simulate less at once", file.string(),
                                 channels.size(), frames));
  std::string header = "RIFF";
  put(header, static_cast<std::uint32_t>(36 + 14 + data));
  header += "WAVEfmt ";
  put(header, std::uint32_t{18});
  put(header, std::uint16_t{3});  // IEEE float
  put(header, static_cast<std::uint16_t>(channels.size()));
  put(header, static_cast<std::uint32_t>(rate_hz));
  put(header, static_cast<std::uint32_t>(static_cast<std::size_t>(rate_hz) * channels.size() * sizeof(float)));
  put(header, static_cast<std::uint16_t>(channels.size() * sizeof(float)));
  put(header, std::uint16_t{32});
  put(header, std::uint16_t{0});
  header += "fact";
  put(header, std::uint32_t{4});
  put(header, static_cast<std::uint32_t>(frames));
  header += "data";
  put(header, static_cast<std::uint32_t>(data));
  base::WholeFile whole(file);
  whole.append(header);
  std::string piece;
  for (std::size_t i = 0; i < frames; ++i) {
    for (const std::vector<double>& channel : channels) put(piece, static_cast<float>(gain_per_pa * channel[i]));
    if (piece.size() > 1 << 20) {
      whole.append(piece);
      piece.clear();
    }
  }
  whole.append(piece);
  whole.commit();
}

std::string draw_spectrogram(const std::vector<std::vector<double>>& channels, int rate_hz, const std::string& title,
                             const std::filesystem::path& folder) {
  sound::SoundStore store(rate_hz, channels.size(), base::Spool(folder, "sound"));
  std::vector<float> frame(channels.size());
  for (std::size_t i = 0; i < channels[0].size(); ++i) {
    for (std::size_t c = 0; c < channels.size(); ++c) frame[c] = static_cast<float>(channels[c][i]);
    store.append(frame);
  }
  return sound::make_spectrogram_png(store, title);
}

}  // namespace carillon::simulation
