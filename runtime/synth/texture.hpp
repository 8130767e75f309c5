// Height of a rough surface along the path of a contact.
//
//   Texture texture;
//   texture.start(2e-6, seed);
//   const auto gains = texture.calc_gains(0.3, 40e-6, 0.0, 48000.0);
//   texture.render(0.3, 0.3, gains, gains, height);
#pragma once

#include <array>
#include <cstdint>

#include "runtime/synth/kernels.hpp"

namespace carillon::synth {

/// Self-affine profile by octaves of wavelength, read at the travelled distance, band-limited to the Nyquist frequency. All surfaces have
/// one spectrum up to their height: roughness includes waves up to kCutoffM, and waviness continues up to kLongestM by the same law.
/// Deterministic by roughness and seed. make_tables() allocates, once; all the rest is [audio-thread]: no heap, no lock, no throw.
class Texture {
 public:
  static constexpr int kOctaves = 16;
  static constexpr double kHurst = 0.8;
  static constexpr double kCutoffM = 0.8e-3;         // cut-off of roughness measurement
  static constexpr int kWavy = 3;                    // octaves of waviness
  static constexpr double kLongestM = 8 * kCutoffM;  // 2^kWavy

  /// Octave amplitudes at one time.
  struct Gains {
    std::array<float, kOctaves> height_m{};  // rms
    double rms_m = 0.0;                      // total
  };

  /// Makes the shared table once: 128 KiB. [main-thread]
  static void make_tables();
  /// Start of a path. roughness_m: rms height [m] as measured, without wavelengths beyond kCutoffM; 0 or less: smooth.
  void start(double roughness_m, std::uint64_t seed) noexcept;

  /// Gains of a contact that sweeps the surface at speed_m_s with a patch of this radius; a second-order high pass at give_rad_s represents
  /// the compliance of the bodies.
  Gains calc_gains(double speed_m_s, double patch_radius_m, double give_rad_s, double rate_hz) const noexcept;

  /// Heights [m] at the samples 0 to kSubBlock, while speed and gains change linearly; advances the path by kSubBlock samples.
  void render(double from_m_s, double to_m_s, double rate_hz, const Gains& from, const Gains& to,
              std::array<float, kSubBlock + 1>& height_m) noexcept;

  /// Upper bound of the one-sided density of the heights [m^2 / Hz] at a frequency; constant below the lowest octave.
  static double calc_density(const Gains& gains, double speed_m_s, double freq_hz) noexcept;
  double get_roughness_m() const noexcept { return roughness_m_; }

 private:
  double roughness_m_ = 0.0;
  std::uint64_t place_ = 0;  // position on the longest octave, in 2^-64 of its table
  std::array<std::uint64_t, kOctaves> offset_{};
};

}  // namespace carillon::synth
