// The picture of a sound: level over time and frequency.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "runtime/render/sound/sound_store.hpp"

namespace carillon::sound {

/// Short-time spectrum. level_db is (frames, bins) row-major: the level re 20 uPa of a steady tone in that bin, mean square of all
/// channels.
struct ShortTimeSpectrum {
  int window = 0;       // samples of a Hann window: at most a tenth of the sound, at least 32
  double bin_hz = 0.0;  // width of a bin
  double duration_s = 0.0;
  std::size_t frames = 0;  // centred at (frame + 1/2) / frames * duration
  std::size_t bins = 0;    // from 0 to half the sample rate, 23 Hz apart up to 48 kHz, for short sounds too
  std::vector<double> level_db;
};
inline constexpr double kFloorDb = -120.0;  // what silence counts as

/// `frames` spectra spread evenly over the sound, of which a window at a time is read; where they lie further apart than half a window, the
/// ones between are averaged in.
ShortTimeSpectrum calc_short_time_spectrum(const SoundStore& sound, std::size_t frames);

/// Where the picture of the spectrum lies in the image, in pixels; frequency runs logarithmically, as it is heard, from lowest_hz at the
/// bottom to the Nyquist frequency at the top.
struct SpectrogramLayout {
  double lowest_hz = 50.0;
  int width = 1400, height = 900;
  int left = 112, top = 190, plot_width = 1140, plot_height = 620;
};

/// Draws the spectrogram with its axes (s, Hz), a colour bar (dB re 20 uPa) and the pressure over time above it; returns the bytes of a PNG
/// file. Throws SystemError when there is no memory for it.
std::string make_spectrogram_png(const SoundStore& sound, const std::string& title);

}  // namespace carillon::sound
