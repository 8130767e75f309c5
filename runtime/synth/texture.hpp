// The height of a rough surface along the path of a contact.
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

/// A self-affine profile, octave of wavelength by octave, read at the distance that the contact has gone. Nothing of it moves faster than
/// the Nyquist frequency. All surfaces have the same spectrum but for their height: roughness counts waves up to kCutoffM, and waviness
/// continues up to kLongestM by the same law. Deterministic: the same roughness and seed give the same surface.
/// make_tables() takes memory and time, once; all the rest is [audio-thread]: no heap, no lock, no throw.
class Texture {
 public:
  static constexpr int kOctaves = 16;
  static constexpr double kHurst = 0.8;
  static constexpr double kCutoffM = 0.8e-3;         // with which roughness is measured
  static constexpr int kWavy = 3;                    // octaves beyond it
  static constexpr double kLongestM = 8 * kCutoffM;  // 2^kWavy

  /// How much of each octave counts at one instant.
  struct Gains {
    std::array<float, kOctaves> height_m{};  // rms
    double rms_m = 0.0;                      // of all of them together
  };

  /// Makes what all surfaces share, when it is not there yet: 128 KiB. [main-thread]
  static void make_tables();
  /// At the start of a path. roughness_m: rms height [m] of the profile as it is measured, without wavelengths beyond kCutoffM; 0 or less:
  /// smooth.
  void start(double roughness_m, std::uint64_t seed) noexcept;

  /// For a contact that goes over the surface with speed_m_s and touches it with a patch of this radius; what moves slower than give_rad_s
  /// is not felt, as the bodies yield to it: a high pass of the second order.
  Gains calc_gains(double speed_m_s, double patch_radius_m, double give_rad_s, double rate_hz) const noexcept;

  /// Heights [m] at the samples 0 to kSubBlock, while speed and gains change linearly from the first to the last; the path advances by
  /// kSubBlock samples.
  void render(double from_m_s, double to_m_s, double rate_hz, const Gains& from, const Gains& to,
              std::array<float, kSubBlock + 1>& height_m) noexcept;

  /// One-sided density of the heights [m^2 / Hz] at a frequency, or a little more; below the lowest the one of the lowest.
  static double calc_density(const Gains& gains, double speed_m_s, double freq_hz) noexcept;
  double get_roughness_m() const noexcept { return roughness_m_; }

 private:
  double roughness_m_ = 0.0;
  std::uint64_t place_ = 0;  // where on the longest octave, in 2^-64 of its table
  std::array<std::uint64_t, kOctaves> offset_{};
};

}  // namespace carillon::synth
