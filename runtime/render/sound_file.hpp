// WAV files.
#pragma once

#include <functional>
#include <string>
#include <string_view>

#include "runtime/scene/scene.hpp"
#include "runtime/render/sound/sound_store.hpp"

namespace carillon::render {

/// Bytes of the file for so many frames. Above 4 GiB it is an RF64 (EBU Tech 3306), which is the form of a WAV file of that length.
std::uint64_t calc_wav_bytes(std::size_t channels, scene::SampleFormat format, std::uint64_t frames);

/// All that stands before the samples. Lengths are in it, so that the file can be written from front to back.
std::string make_wav_header(int rate_hz, std::size_t channels, scene::SampleFormat format, std::uint64_t frames);

/// A WAV file in pieces, in order: a channel for each of the sound, pressure times `gain_per_pa`, full scale 1. Throws SystemError when
/// libsndfile refuses, and what `sink` throws.
void write_wav(const sound::SoundStore& sound, double gain_per_pa, scene::SampleFormat format, const std::function<void(std::string_view)>& sink);

}  // namespace carillon::render
