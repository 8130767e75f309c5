// Sound files: WAV, FLAC, Opus, Vorbis.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string_view>

#include "runtime/base/file.hpp"
#include "runtime/render/sound/sound_store.hpp"
#include "runtime/render/sound/wav_header.hpp"
#include "runtime/scene/scene.hpp"

namespace carillon::render {

/// Container and codec of a sound file, by its extension: .wav or .wave, .flac, .opus, .ogg.
enum class SoundCodec { kWav, kFlac, kOpus, kVorbis };

/// Throws InputError, with the remedy, for another extension and for a rate, channels or samples that the codec does not have. Opus and
/// Vorbis have no sample format: `has_format`, one was asked for.
SoundCodec find_codec(const std::filesystem::path& file, int rate_hz, std::size_t channels, scene::SampleFormat format, bool has_format);

sound::SampleKind get_sample_kind(scene::SampleFormat format);

/// Size of a WAV file in bytes.
std::uint64_t calc_wav_bytes(std::size_t channels, scene::SampleFormat format, std::uint64_t frames);

/// Writes a WAV file in pieces, in order: one channel per channel of the sound, pressure times `gain_per_pa`, full scale 1. Throws
/// SystemError for an error of libsndfile, and the exceptions of `sink`.
void write_wav(const sound::SoundStore& sound, double gain_per_pa, scene::SampleFormat format,
               const std::function<void(std::string_view)>& sink);

/// Appends the same sound to an empty file with another codec than WAV. FLAC has the samples of the WAV file, bit for bit. Memory does not
/// grow with the sound. Throws as write_wav does.
void write_coded(const sound::SoundStore& sound, double gain_per_pa, scene::SampleFormat format, SoundCodec codec, base::WholeFile& file);

}  // namespace carillon::render
