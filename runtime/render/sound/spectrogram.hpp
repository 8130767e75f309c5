// Spectrogram of a sound as a picture.
#pragma once

#include <string>
#include <vector>

#include "runtime/render/sound/sound_store.hpp"

namespace carillon::sound {

/// Short-time spectrum. level_db is (frames, bins) row-major: level re 20 uPa of a steady tone in that bin, mean square over channels.
struct ShortTimeSpectrum {
  int window = 0;       // samples of a Hann window, at least 32, at most a tenth of the sound
  double bin_hz = 0.0;  // width of a bin
  double duration_s = 0.0;
  std::size_t frames = 0;  // centred at (frame + 1/2) / frames * duration
  std::size_t bins = 0;    // from 0 to half the sample rate; 23 Hz apart up to 48 kHz, also for short sounds
  std::vector<double> level_db;
};
inline constexpr double kFloorDb = -120.0;  // level of silence

/// `frames` spectra evenly spread over the sound, read one window at a time. If they lie more than half a window apart, intermediate
/// spectra are averaged in.
ShortTimeSpectrum calc_short_time_spectrum(const SoundStore& sound, std::size_t frames);

/// Plot area in the image, in pixels. Frequency is logarithmic, from lowest_hz at the bottom to the Nyquist frequency at the top.
struct SpectrogramLayout {
  double lowest_hz = 50.0;
  int width = 1400, height = 900;
  int left = 112, top = 190, plot_width = 1140, plot_height = 620;
};

/// Draws the spectrogram with axes (s, Hz), colour bar (dB re 20 uPa) and the waveform above it; returns the bytes of a PNG file. Throws
/// SystemError if memory runs out.
std::string make_spectrogram_png(const SoundStore& sound, const std::string& title);

}  // namespace carillon::sound
