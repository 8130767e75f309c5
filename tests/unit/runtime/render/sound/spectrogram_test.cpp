#include "runtime/render/sound/spectrogram.hpp"

#include <cairo.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstring>
#include <numbers>
#include <string>

#include "runtime/render/sound/axis.hpp"

namespace carillon::sound {
namespace {

SoundStore make_tone(double freq_hz, double amplitude_pa, int rate_hz, double seconds, int click_at = -1) {
  SoundStore sound(rate_hz, 2);
  for (int n = 0; n < seconds * rate_hz; ++n) {
    const float p = n == click_at ? 1.0F : static_cast<float>(amplitude_pa * std::sin(2 * std::numbers::pi * freq_hz * n / rate_hz));
    sound.append(std::array{p, p});
  }
  return sound;
}

/// Brightness of the pixels of the PNG.
struct Picture {
  int width = 0, height = 0;
  std::vector<int> brightness;
  explicit Picture(const std::string& png) {
    struct Source {
      const std::string* bytes;
      std::size_t at;
    } source{&png, 0};
    const auto read = [](void* closure, unsigned char* data, unsigned int length) {
      auto& from = *static_cast<Source*>(closure);
      if (from.at + length > from.bytes->size()) return CAIRO_STATUS_READ_ERROR;
      std::memcpy(data, from.bytes->data() + from.at, length);
      from.at += length;
      return CAIRO_STATUS_SUCCESS;
    };
    cairo_surface_t* surface = cairo_image_surface_create_from_png_stream(read, &source);
    EXPECT_EQ(cairo_surface_status(surface), CAIRO_STATUS_SUCCESS);
    width = cairo_image_surface_get_width(surface);
    height = cairo_image_surface_get_height(surface);
    for (int y = 0; y < height; ++y) {
      const unsigned char* row = cairo_image_surface_get_data(surface) + y * cairo_image_surface_get_stride(surface);
      for (int x = 0; x < width; ++x) brightness.push_back(row[4 * x] + row[4 * x + 1] + row[4 * x + 2]);
    }
    cairo_surface_destroy(surface);
  }
  int at(int x, int y) const { return brightness[static_cast<std::size_t>(y) * width + x]; }
};

TEST(Spectrogram, ToneHasItsLevelAndBin) {
  // 1 Pa rms is 93.98 dB; 46 bins of 48000 / 2048 Hz exactly, and 0.4 of a bin next to it.
  const double bin_hz = 48000.0 / 2048.0;
  const auto on = calc_short_time_spectrum(make_tone(46 * bin_hz, std::sqrt(2.0), 48000, 1.0), 50);
  ASSERT_EQ(on.window, 2048);
  EXPECT_NEAR(on.level_db[25 * on.bins + 46], 93.979, 0.01);
  EXPECT_LT(on.level_db[25 * on.bins + 60], 40.0);
  const auto off_centre = calc_short_time_spectrum(make_tone(46.4 * bin_hz, std::sqrt(2.0), 48000, 1.0), 50);
  EXPECT_NEAR(off_centre.level_db[25 * off_centre.bins + 46], 93.979, 1.0);
}

TEST(Spectrogram, LongSoundIsAveragedBetweenColumns) {
  // 100 columns over 20 s: a click at any time must be visible.
  const SoundStore sound = make_tone(1000.0, 0.0, 48000, 20.0, 48000 * 7 + 3210);
  const auto spectrum = calc_short_time_spectrum(sound, 100);
  double loudest = kFloorDb;
  std::size_t where = 0;
  for (std::size_t frame = 0; frame < 100; ++frame) {
    if (spectrum.level_db[frame * spectrum.bins + 400] > loudest) {
      loudest = spectrum.level_db[frame * spectrum.bins + 400];
      where = frame;
    }
  }
  EXPECT_GT(loudest, 0.0);
  EXPECT_EQ(where, 35u);
}

TEST(Spectrogram, ShortSoundShowsItsOnset) {
  // A tone of 3 kHz from the middle of short sounds: silence a twentieth before its onset, full level a twentieth after it.
  for (const double seconds : {0.01, 0.03, 0.1, 0.3}) {
    SoundStore sound(48000, 1);
    const int samples = static_cast<int>(seconds * 48000);
    for (int n = 0; n < samples; ++n)
      sound.append(std::array{n < samples / 2 ? 0.0F : static_cast<float>(std::sin(2 * std::numbers::pi * 3000.0 * n / 48000))});
    const auto spectrum = calc_short_time_spectrum(sound, 200);
    const auto level = [&](std::size_t frame) { return spectrum.level_db[frame * spectrum.bins + 128]; };
    EXPECT_EQ(spectrum.bin_hz, 48000.0 / 2048.0);
    EXPECT_EQ(level(89), kFloorDb) << seconds;
    EXPECT_NEAR(level(110), 90.97, 0.1) << seconds;
  }
  EXPECT_EQ(calc_short_time_spectrum(make_tone(1000.0, 1.0, 48000, 0.43), 10).window, 2048);
}

TEST(Spectrogram, RidgeOfAToneIsAtItsPixelRow) {
  const SpectrogramLayout at;
  for (const int rate : {48000, 44100, 8000}) {
    for (const double part : {0.11, 0.5, 0.83}) {
      const double freq = part * rate / 2;
      const Picture picture(make_spectrogram_png(make_tone(freq, 0.3, rate, 1.0), "a tone"));
      ASSERT_EQ(picture.width, at.width);
      ASSERT_EQ(picture.height, at.height);
      for (const int x : {at.left + at.plot_width / 4, at.left + at.plot_width / 2}) {
        int best = at.top;
        for (int y = at.top; y < at.top + at.plot_height; ++y) {
          if (picture.at(x, y) > picture.at(x, best)) best = y;
        }
        // Rows have equal frequency ratios; a tone between two bins may peak half a bin off.
        const double rows_per_ratio = at.plot_height / std::log(0.5 * rate / at.lowest_hz);
        const double expected = at.top + rows_per_ratio * std::log(0.5 * rate / freq);
        EXPECT_NEAR(best + 0.5, expected, 1.6 + rows_per_ratio * 12.0 / freq) << freq << " Hz at " << rate;
        EXPECT_LT(picture.at(x, at.top + at.plot_height / 4 + (part > 0.6 ? 200 : 0)), 150);
      }
    }
  }
}

TEST(Spectrogram, SilenceIsDark) {
  const SpectrogramLayout at;
  const Picture picture(make_spectrogram_png(make_tone(1000.0, 0.0, 48000, 0.2), "silence"));
  for (int x = at.left; x < at.left + at.plot_width; x += 50) EXPECT_LT(picture.at(x, at.top + at.plot_height / 2), 10);
}

TEST(Spectrogram, VeryShortSoundIsDrawn) {
  const Picture picture(make_spectrogram_png(make_tone(1000.0, 1.0, 48000, 5e-5), "two samples"));
  EXPECT_GT(picture.width, 0);
}

TEST(Axis, PressuresHaveTwoDigitsAndASuitableUnit) {
  const struct {
    double pa;
    const char *text, *unit;
  } cases[] = {{470.3, "470", "Pa"},      {47.03, "47", "Pa"},     {0.047, "0.047", "Pa"}, {0.5, "0.5", "Pa"},
               {0.0099, "9.9", "mPa"},    {0.00999, "0.01", "Pa"}, {996.0, "1", "kPa"},    {2e5, "200", "kPa"},
               {3.21e-5, "0.032", "mPa"}, {7.4e-6, "7.4", "µPa"},  {0.0, "0", "Pa"}};
  for (const auto& c : cases) {
    const Label label = make_pressure_label(c.pa);
    EXPECT_EQ(label.text, c.text) << c.pa;
    EXPECT_EQ(label.unit, c.unit) << c.pa;
  }
  for (double pa = 1e-8; pa < 1e6; pa *= 1.0173) {
    const Label label = make_pressure_label(pa);
    EXPECT_EQ(label.text.find('e'), std::string::npos) << pa;
    EXPECT_LE(label.text.size(), pa < 1e-7 ? 7U : 5U) << pa << " " << label.text;
    const double unit = label.unit == "µPa" ? 1e-6 : label.unit == "mPa" ? 1e-3 : label.unit == "Pa" ? 1.0 : 1e3;
    EXPECT_NEAR(std::stod(label.text) * unit / pa, 1.0, 0.051) << pa << " " << label.text;
  }
}

TEST(Axis, TicksOfTimeAreRoundAndFew) {
  for (double duration = 1e-4; duration < 4000.0; duration *= 1.013) {
    const TimeAxis axis = make_time_axis(duration);
    const double unit = axis.unit == "s" ? 1.0 : axis.unit == "ms" ? 1e-3 : 1e-6;
    ASSERT_GE(axis.marks.size(), 4U) << duration;
    ASSERT_LE(axis.marks.size(), 11U) << duration;
    EXPECT_EQ(axis.marks[0].text, "0");
    for (const AxisTick& mark : axis.marks) {
      EXPECT_LE(mark.text.size(), 4U) << duration << " " << mark.text;
      EXPECT_NEAR(std::stod(mark.text) * unit, mark.at_s, 1e-9 * duration) << mark.text;
      EXPECT_LE(mark.at_s, duration * (1 + 1e-8));
    }
  }
  EXPECT_EQ(make_time_axis(1.5).marks[1].text, "0.2");
  EXPECT_EQ(make_time_axis(3600.0).marks[1].text, "500");
  EXPECT_EQ(make_time_axis(0.25).unit, "ms");
}

}  // namespace
}  // namespace carillon::sound
