// WAV files.
#pragma once

#include <functional>
#include <string>
#include <string_view>

#include "runtime/render/sound/sound_store.hpp"
#include "runtime/scene/scene.hpp"

namespace carillon::render {

/// Size of the file in bytes. Above 4 GiB it is an RF64 (EBU Tech 3306).
std::uint64_t calc_wav_bytes(std::size_t channels, scene::SampleFormat format, std::uint64_t frames);

/// The header, including lengths, so that the file can be written sequentially.
std::string make_wav_header(int rate_hz, std::size_t channels, scene::SampleFormat format, std::uint64_t frames);

/// Writes a WAV file in pieces, in order: one channel per channel of the sound, pressure times `gain_per_pa`, full scale 1. Throws
/// SystemError for an error of libsndfile, and the exceptions of `sink`.
void write_wav(const sound::SoundStore& sound, double gain_per_pa, scene::SampleFormat format,
               const std::function<void(std::string_view)>& sink);

}  // namespace carillon::render
