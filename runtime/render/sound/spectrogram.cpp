// Method: Hann-windowed Fourier transforms, mean square over channels, scaled to the level of a steady tone.
// Source: Harris 1978 (windows); colour map "magma" of matplotlib (van der Walt & Smith 2015, CC0), nine of its points.
#include "runtime/render/sound/spectrogram.hpp"

#include <cairo.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <memory>
#include <numbers>
#include <unsupported/Eigen/FFT>

#include "runtime/render/sound/axis.hpp"

namespace carillon::sound {
namespace {

constexpr double kReferencePa = 20e-6;
constexpr double kRangeDb = 90.0;
constexpr int kWindowsOfSound = 10, kShortestWindow = 32;

struct Color {
  double r, g, b;
};

constexpr std::array<Color, 9> kMagma{{{0, 0, 4},
                                       {28, 16, 68},
                                       {79, 18, 123},
                                       {129, 37, 129},
                                       {181, 54, 122},
                                       {229, 80, 100},
                                       {251, 135, 97},
                                       {254, 194, 135},
                                       {252, 253, 191}}};

/// Colour at 0 (quiet) to 1 (loud), components 0..255.
Color calc_color(double level) {
  const double x = std::clamp(level, 0.0, 1.0) * (kMagma.size() - 1);
  const auto i = std::min<std::size_t>(static_cast<std::size_t>(x), kMagma.size() - 2);
  const double u = x - static_cast<double>(i);
  const Color &a = kMagma[i], &b = kMagma[i + 1];
  return {a.r + u * (b.r - a.r), a.g + u * (b.g - a.g), a.b + u * (b.b - a.b)};
}

using Surface = std::unique_ptr<cairo_surface_t, decltype(&cairo_surface_destroy)>;
using Context = std::unique_ptr<cairo_t, decltype(&cairo_destroy)>;

enum class Anchor { kLeft, kCentre, kRight };

void draw_text(cairo_t* cr, double x, double y, const std::string& text, Anchor anchor) {
  cairo_text_extents_t extents;
  cairo_text_extents(cr, text.c_str(), &extents);
  const double shift = anchor == Anchor::kLeft ? 0.0 : anchor == Anchor::kCentre ? 0.5 : 1.0;
  cairo_move_to(cr, std::round(x - shift * extents.x_advance), std::round(y));
  cairo_show_text(cr, text.c_str());
}

void draw_upright_text(cairo_t* cr, double x, double y, const std::string& text) {
  cairo_save(cr);
  cairo_translate(cr, x, y);
  cairo_rotate(cr, -std::numbers::pi / 2);
  draw_text(cr, 0.0, 0.0, text, Anchor::kCentre);
  cairo_restore(cr);
}

void draw_line(cairo_t* cr, double x0, double y0, double x1, double y1) {
  cairo_move_to(cr, x0, y0);
  cairo_line_to(cr, x1, y1);
  cairo_stroke(cr);
}

void draw_frame(cairo_t* cr, double x, double y, double width, double height) {
  cairo_rectangle(cr, x - 0.5, y - 0.5, width + 1, height + 1);
  cairo_stroke(cr);
}

/// Level of a picture row: the loudest bin it covers, or interpolated between the two nearest bins.
double find_row_level(const ShortTimeSpectrum& spectrum, std::size_t frame, double low_bin, double high_bin) {
  const double* row = &spectrum.level_db[frame * spectrum.bins];
  const auto first = static_cast<std::size_t>(std::ceil(low_bin));
  const auto last = std::min(static_cast<std::size_t>(std::floor(high_bin)), spectrum.bins - 1);
  if (first <= last) return *std::max_element(row + first, row + last + 1);
  const double middle = std::clamp(0.5 * (low_bin + high_bin), 0.0, static_cast<double>(spectrum.bins - 1));
  const auto i = std::min(static_cast<std::size_t>(middle), spectrum.bins - 2);
  return row[i] + (middle - static_cast<double>(i)) * (row[i + 1] - row[i]);
}

Surface make_image(int width, int height) {
  Surface image(cairo_image_surface_create(CAIRO_FORMAT_RGB24, width, height), cairo_surface_destroy);
  if (cairo_surface_status(image.get()) != CAIRO_STATUS_SUCCESS) throw SystemError("cannot draw the spectrogram: not enough memory");
  return image;
}

void set_pixel(cairo_surface_t* image, int x, int y, const Color& color) {
  unsigned char* row = cairo_image_surface_get_data(image) + static_cast<std::ptrdiff_t>(y) * cairo_image_surface_get_stride(image);
  const auto byte = [](double v) { return static_cast<std::uint32_t>(std::lround(std::clamp(v, 0.0, 255.0))); };
  reinterpret_cast<std::uint32_t*>(row)[x] = byte(color.r) << 16 | byte(color.g) << 8 | byte(color.b);
}

void draw_spectrum(cairo_t* cr, const SpectrogramLayout& at, const ShortTimeSpectrum& spectrum, double top_db) {
  const Surface image = make_image(at.plot_width, at.plot_height);
  cairo_surface_flush(image.get());
  const double octaves = std::log2(static_cast<double>(spectrum.bins - 1) * spectrum.bin_hz / at.lowest_hz);
  const auto find_bin = [&](int y) { return at.lowest_hz / spectrum.bin_hz * std::exp2(octaves * (at.plot_height - y) / at.plot_height); };
  for (int x = 0; x < at.plot_width; ++x) {
    const std::size_t frame = x;
    for (int y = 0; y < at.plot_height; ++y) {
      const double level = find_row_level(spectrum, frame, find_bin(y + 1), find_bin(y));
      set_pixel(image.get(), x, y, calc_color((level - top_db + kRangeDb) / kRangeDb));
    }
  }
  cairo_surface_mark_dirty(image.get());
  cairo_set_source_surface(cr, image.get(), at.left, at.top);
  cairo_paint(cr);
  cairo_set_source_rgb(cr, 0.15, 0.15, 0.15);
  draw_frame(cr, at.left, at.top, at.plot_width, at.plot_height);
}

void draw_axes(cairo_t* cr, const SpectrogramLayout& at, double duration_s, double nyquist_hz) {
  const double bottom = at.top + at.plot_height;
  cairo_set_font_size(cr, 17);
  const TimeAxis time = make_time_axis(duration_s);
  for (const AxisTick& mark : time.marks) {
    const double x = std::round(at.left + mark.at_s / duration_s * at.plot_width) + 0.5;
    draw_line(cr, x, bottom, x, bottom + 7);
    draw_text(cr, x, bottom + 26, mark.text, Anchor::kCentre);
  }
  draw_text(cr, at.left + at.plot_width / 2, bottom + 56, fmt::format("Time ({})", time.unit), Anchor::kCentre);
  const double octaves = std::log2(nyquist_hz / at.lowest_hz);
  for (double decade = 10; decade <= nyquist_hz; decade *= 10) {
    for (int digit = 1; digit < 10; ++digit) {
      const double freq_hz = digit * decade;
      if (freq_hz < at.lowest_hz || freq_hz > nyquist_hz) continue;
      const bool labelled = digit == 1 || digit == 2 || digit == 5;
      const double y = std::round(bottom - std::log2(freq_hz / at.lowest_hz) / octaves * at.plot_height) + 0.5;
      draw_line(cr, at.left - (labelled ? 8 : 5), y, at.left - 1, y);
      if (labelled) draw_text(cr, at.left - 13, y + 6, fmt::format("{:g}", freq_hz), Anchor::kRight);
    }
  }
  draw_upright_text(cr, 28, at.top + at.plot_height / 2, "Frequency (Hz)");
}

void draw_color_bar(cairo_t* cr, const SpectrogramLayout& at, double top_db) {
  const int width = 22;
  const double x = at.left + at.plot_width + 28;
  const Surface bar = make_image(width, at.plot_height);
  cairo_surface_flush(bar.get());
  for (int y = 0; y < at.plot_height; ++y) {
    for (int i = 0; i < width; ++i) set_pixel(bar.get(), i, y, calc_color(1.0 - (y + 0.5) / at.plot_height));
  }
  cairo_surface_mark_dirty(bar.get());
  cairo_set_source_surface(cr, bar.get(), x, at.top);
  cairo_paint(cr);
  cairo_set_source_rgb(cr, 0.15, 0.15, 0.15);
  draw_frame(cr, x, at.top, width, at.plot_height);
  for (double db = top_db; db >= top_db - kRangeDb - 1e-9; db -= 10.0) {
    const double y = std::round(at.top + (top_db - db) / kRangeDb * at.plot_height) + 0.5;
    draw_line(cr, x + width + 1, y, x + width + 7, y);
    draw_text(cr, x + width + 48, y + 6, fmt::format("{:g}", db), Anchor::kRight);
  }
  draw_upright_text(cr, x + width + 80, at.top + at.plot_height / 2, "Level (dB re 20 µPa)");
}

/// Waveform over all channels: minimum to maximum per column.
struct Spans {
  explicit Spans(std::size_t columns) : low(columns, 0.0), high(columns, 0.0) {}
  std::vector<double> low, high;
  double peak_pa = 0.0;
};

Spans find_spans(const SoundStore& sound, std::size_t columns) {
  Spans spans(columns);
  const std::uint64_t samples = sound.get_frames();
  const std::size_t channels = sound.get_channels();
  const auto find_first = [&](std::size_t x) { return samples * x / columns; };
  std::size_t begin = 0;  // first column that may still receive samples
  sound.for_each_piece([&](std::uint64_t first, std::span<const float> frames) {
    const std::uint64_t end = first + frames.size() / channels;
    while (begin < columns && std::max(find_first(begin) + 1, find_first(begin + 1)) <= first) ++begin;
    for (std::size_t x = begin; x < columns && find_first(x) < end; ++x) {
      const std::uint64_t from = std::max(find_first(x), first), until = std::min(end, std::max(find_first(x) + 1, find_first(x + 1)));
      for (std::size_t i = static_cast<std::size_t>(from - first) * channels; from < until && i < (until - first) * channels; ++i) {
        const auto p = static_cast<double>(frames[i]);
        spans.low[x] = std::min(spans.low[x], p);
        spans.high[x] = std::max(spans.high[x], p);
      }
    }
  });
  for (std::size_t x = 0; x < columns; ++x) spans.peak_pa = std::max({spans.peak_pa, spans.high[x], -spans.low[x]});
  return spans;
}

void draw_pressure(cairo_t* cr, const SpectrogramLayout& at, const Spans& spans) {
  const double top = 60, height = at.top - top - 16, middle = top + height / 2;
  const double scale = spans.peak_pa > 0.0 ? (height / 2 - 3) / spans.peak_pa : 0.0;
  cairo_set_line_width(cr, 1.0);
  cairo_set_source_rgb(cr, 0.32, 0.07, 0.48);
  for (int x = 0; x < at.plot_width; ++x) {
    const std::size_t column = x;
    draw_line(cr, at.left + x + 0.5, middle - spans.high[column] * scale - 0.5, at.left + x + 0.5,
              middle - spans.low[column] * scale + 0.5);
  }
  cairo_set_source_rgb(cr, 0.15, 0.15, 0.15);
  draw_frame(cr, at.left, top, at.plot_width, height);
  cairo_set_font_size(cr, 15);
  const Label peak = make_pressure_label(spans.peak_pa);
  if (spans.peak_pa > 0.0) {
    draw_text(cr, at.left - 8, top + 14, peak.text, Anchor::kRight);
    draw_text(cr, at.left - 8, top + height, "−" + peak.text, Anchor::kRight);
  }
  draw_upright_text(cr, 28, middle, fmt::format("Pressure ({})", peak.unit));
}

cairo_status_t append_bytes(void* closure, const unsigned char* data, unsigned int length) {
  static_cast<std::string*>(closure)->append(reinterpret_cast<const char*>(data), length);
  return CAIRO_STATUS_SUCCESS;
}

}  // namespace

ShortTimeSpectrum calc_short_time_spectrum(const SoundStore& sound, std::size_t frames) {
  const auto samples = static_cast<std::int64_t>(sound.get_frames());
  const std::size_t channels = sound.get_channels();
  const int rate_hz = sound.get_rate_hz();
  ShortTimeSpectrum spectrum;
  // About 23 Hz per bin separates the modes of a bowl and sharp impacts. Short sounds: a shorter, zero-padded window with the same bins.
  int length = 256;
  while (length < 16384 && length * 23.5 < rate_hz) length *= 2;
  spectrum.window = length;
  while (spectrum.window > kShortestWindow && spectrum.window * kWindowsOfSound > samples) spectrum.window /= 2;
  const int window = spectrum.window;
  spectrum.bin_hz = static_cast<double>(rate_hz) / length;
  spectrum.duration_s = static_cast<double>(std::max<std::int64_t>(samples, 1)) / rate_hz;
  spectrum.frames = frames;
  spectrum.bins = static_cast<std::size_t>(length) / 2 + 1;
  spectrum.level_db.assign(frames * spectrum.bins, kFloorDb);

  std::vector<double> hann(window);
  double total = 0.0;
  for (int i = 0; i < window; ++i) total += hann[i] = 0.5 - 0.5 * std::cos(2.0 * std::numbers::pi * (i + 0.5) / window);
  const double hop = static_cast<double>(samples) / static_cast<double>(frames);
  const int parts = std::max(1, static_cast<int>(std::ceil(hop / (0.5 * window))));
  Eigen::FFT<double> fft;
  std::vector<double> piece(length, 0.0);
  std::vector<float> heard;  // one window, all channels
  std::vector<std::complex<double>> transform;
  std::vector<double> power(spectrum.bins);
  for (std::size_t frame = 0; frame < frames; ++frame) {
    std::fill(power.begin(), power.end(), 0.0);
    for (int part = 0; part < parts; ++part) {
      const double centre = (static_cast<double>(frame) + (part + 0.5) / parts) * hop;
      const auto first = static_cast<std::int64_t>(std::floor(centre)) - window / 2;
      const std::int64_t from = std::clamp<std::int64_t>(first, 0, samples), until = std::clamp<std::int64_t>(first + window, 0, samples);
      heard.assign(static_cast<std::size_t>(window) * channels, 0.0F);
      sound.read(static_cast<std::uint64_t>(from), std::span(heard).subspan(static_cast<std::size_t>(from - first) * channels,
                                                                            static_cast<std::size_t>(until - from) * channels));
      for (std::size_t c = 0; c < channels; ++c) {
        for (std::size_t i = 0; i < hann.size(); ++i) piece[i] = hann[i] * static_cast<double>(heard[i * channels + c]);
        fft.fwd(transform, piece);
        for (std::size_t bin = 0; bin < spectrum.bins; ++bin) power[bin] += std::norm(transform[bin]);
      }
    }
    for (std::size_t bin = 0; bin < spectrum.bins; ++bin) {
      // A tone of amplitude A has |X| = A total / 2 and mean square A^2 / 2.
      const double mean_square = 2.0 * power[bin] / (total * total) / (static_cast<double>(channels) * parts);
      const double level = 10.0 * std::log10(mean_square / (kReferencePa * kReferencePa));
      spectrum.level_db[frame * spectrum.bins + bin] = std::max(level, kFloorDb);
    }
  }
  return spectrum;
}

std::string make_spectrogram_png(const SoundStore& sound, const std::string& title) {
  const SpectrogramLayout at;
  const ShortTimeSpectrum spectrum = calc_short_time_spectrum(sound, static_cast<std::size_t>(at.plot_width));
  const double loudest = *std::max_element(spectrum.level_db.begin(), spectrum.level_db.end());
  const double top_db = loudest > kFloorDb ? 10.0 * std::ceil(loudest / 10.0) : 0.0;

  const Surface image = make_image(at.width, at.height);
  const Context context(cairo_create(image.get()), cairo_destroy);
  cairo_t* cr = context.get();
  cairo_set_source_rgb(cr, 1, 1, 1);
  cairo_paint(cr);
  cairo_select_font_face(cr, "DejaVu Sans", CAIRO_FONT_SLANT_NORMAL, CAIRO_FONT_WEIGHT_NORMAL);
  cairo_set_line_width(cr, 1.0);
  draw_spectrum(cr, at, spectrum, top_db);
  draw_axes(cr, at, spectrum.duration_s, 0.5 * sound.get_rate_hz());
  draw_color_bar(cr, at, top_db);
  draw_pressure(cr, at, find_spans(sound, static_cast<std::size_t>(at.plot_width)));
  cairo_set_font_size(cr, 21);
  draw_text(cr, at.left, 40, title, Anchor::kLeft);
  cairo_surface_flush(image.get());
  std::string png;
  if (cairo_surface_write_to_png_stream(image.get(), append_bytes, &png) != CAIRO_STATUS_SUCCESS) {
    throw SystemError("cannot draw the spectrogram: cairo could not make the PNG");
  }
  return png;
}

}  // namespace carillon::sound
