// Method:     sum of octaves, which all read one table at their own scale and from a random position: a sum of cosines with random phases
//             and wavelengths in 1/2 .. 1, band-limited to the octave. The table holds the coefficients of the interpolating cubic
//             B-spline, at least 8 points per wavelength (images below -67 dB), so a height costs four products. The table position is a
//             64-bit fixed-point number; that of the next octave is the same, shifted by one bit. Octaves fade out before the Nyquist
//             frequency.
// Source:     B. Persson, O. Albohr, U. Tartaglino, A. Volokitin and E. Tosatti, J. Phys.: Condens. Matter 17 (2005) R1: most surfaces are
//             self-affine with a Hurst exponent near 0.8 below a roll-off wavelength; the spectrum of a line over such a surface falls as
//             q^-(1 + 2 H). Roughness is measured with a cut-off of 0.8 mm (ISO 4288:1996, for Ra from 0.1 to 2 um). A patch of radius a
//             transmits heights of wave number q by 1 / sqrt(1 + pi/4 (q a)^3): P. Remington, J. Sound Vib. 46 (1976) 419, for wheels on
//             rails.
// Deviations: the standard uses longer cut-offs for rougher surfaces; level would then follow only the power 0.5 of roughness, where 0.8 to
//             1.16 is measured: here one cut-off is used. Filters are evaluated at the centre of each octave, without phase.
#include "runtime/synth/texture.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <vector>

#include "runtime/base/chance.hpp"
#include "runtime/synth/smooth_step.hpp"

namespace carillon::synth {
namespace {

using std::numbers::pi;

constexpr int kBits = 15;
constexpr int kPoints = 1 << kBits;
constexpr int kWaves = 2048;                      // longest wavelengths in the table
constexpr double kFadeFrom = 0.4, kFadeTo = 0.5;  // of the rate: fade-out of the shortest wavelength of an octave
constexpr double kHighestM = 1.0;                 // rms height; keeps the following within floats
constexpr float kMin = 1e-4F;                     // of an octave: smaller ones are left out
constexpr float kFraction = 1.0F / static_cast<float>(1U << 24);

/// x[n] = sum over k of X[k] e^{2 pi i k n / N}, in place; N a power of two (Cooley and Tukey 1965).
void transform(std::vector<std::complex<double>>& x) {
  const std::size_t n = x.size();
  for (std::size_t i = 1, j = 0; i < n; ++i) {
    std::size_t bit = n >> 1;
    for (; (j & bit) != 0; bit >>= 1) j ^= bit;
    j ^= bit;
    if (i < j) std::swap(x[i], x[j]);
  }
  for (std::size_t length = 2; length <= n; length *= 2) {
    for (std::size_t k = 0; k < length / 2; ++k) {
      const std::complex<double> turn = std::polar(1.0, 2.0 * pi * static_cast<double>(k) / static_cast<double>(length));
      for (std::size_t i = k; i < n; i += length) {
        const std::complex<double> even = x[i], odd = x[i + length / 2] * turn;
        x[i] = even + odd;
        x[i + length / 2] = even - odd;
      }
    }
  }
}

struct Tables {
  std::array<float, kPoints + 3> coefficient;  // first three repeated at the end

  Tables() {
    std::vector<std::complex<double>> x(kPoints);
    std::uint64_t seed = 0x0ca4111075;
    double power = 0.0;
    for (int k = kWaves; k < 2 * kWaves; ++k) {
      const double amplitude = std::pow(static_cast<double>(k) / kWaves, -0.5 * (1.0 + 2.0 * Texture::kHurst));
      const double spline = (2.0 + std::cos(2.0 * pi * k / kPoints)) / 3.0;
      power += 0.5 * amplitude * amplitude;
      x[k] = std::polar(amplitude / spline, 2.0 * pi * base::to_unit(base::draw(seed)));
    }
    transform(x);
    for (int n = 0; n < kPoints + 3; ++n) {
      const double value = x[n % kPoints].real() / std::sqrt(power);
      coefficient[n] = static_cast<float>(value);
    }
  }
};

const Tables& get_tables() {
  static const Tables tables;
  return tables;
}

/// Position on the table of the longest octave, to 2^-64 of a turn.
std::uint64_t to_place(double turns) noexcept { return static_cast<std::uint64_t>((turns - std::floor(turns)) * 0x1p64); }

}  // namespace

void Texture::make_tables() { get_tables(); }

void Texture::start(double roughness_m, std::uint64_t seed) noexcept {
  roughness_m_ = std::clamp(roughness_m, 0.0, kHighestM);
  place_ = 0;
  for (std::uint64_t& offset : offset_) offset = base::draw(seed);
}

Texture::Gains Texture::calc_gains(double speed_m_s, double patch_radius_m, double give_rad_s, double rate_hz) const noexcept {
  // Squares of all octaves below the cut-off sum to 1.
  static const double kShare = std::sqrt(1.0 - std::pow(2.0, -2.0 * kHurst)) * std::pow(2.0, kHurst * kWavy);
  static const double kStep = std::pow(2.0, -kHurst);
  Gains gains;
  if (!(roughness_m_ > 0.0)) return gains;
  double amplitude = kShare, longest_m = kLongestM, square = 0.0;
  for (float& height : gains.height_m) {
    const double highest = 2.0 * std::abs(speed_m_s) / (longest_m * rate_hz);  // frequency over rate
    if (highest >= kFadeTo) break;                                             // and all shorter octaves
    const double wave_number = 2.0 * pi * std::numbers::sqrt2 / longest_m;     // centre of the octave
    const double qa = wave_number * patch_radius_m, omega = wave_number * std::abs(speed_m_s);
    double gain = 1.0 / std::sqrt(1.0 + 0.25 * pi * qa * qa * qa);
    gain *= 1.0 - calc_smooth_step((highest - kFadeFrom) / (kFadeTo - kFadeFrom));
    if (give_rad_s > 0.0) gain *= omega * omega / (omega * omega + give_rad_s * give_rad_s);
    gain = std::max(0.0, (gain * amplitude - kMin) / (1.0 - kMin));
    height = static_cast<float>(roughness_m_ * gain);
    square += static_cast<double>(height) * static_cast<double>(height);
    amplitude *= kStep;
    longest_m *= 0.5;
  }
  gains.rms_m = std::sqrt(square);
  return gains;
}

double Texture::calc_density(const Gains& gains, double speed_m_s, double freq_hz) noexcept {
  const double lowest_hz = std::abs(speed_m_s) / kLongestM;
  if (!(lowest_hz > 0.0)) return 0.0;
  // Within an octave from f on the density falls as frequency^-(1 + 2 H): below the chord from its begin to its end.
  static const double kSteep = 2.0 * kHurst / (1.0 - std::pow(2.0, -2.0 * kHurst)), kEnd = std::pow(2.0, -1.0 - 2.0 * kHurst);
  int octave = 0;
  double share = 2.0 * std::frexp(std::max(freq_hz / lowest_hz, 1.0), &octave) - 1.0;  // 0 at the begin, 1 at the end
  if (--octave >= kOctaves) octave = kOctaves - 1, share = 1.0;
  const auto calc_begin = [&](int i) {
    const double height = static_cast<double>(gains.height_m[i]);
    return kSteep * height * height / std::ldexp(lowest_hz, i);
  };
  const double own = calc_begin(octave) * (1.0 - (1.0 - kEnd) * share);
  return octave == 0 ? own : std::max(own, kEnd * calc_begin(octave - 1) * (1.0 - (1.0 - kEnd) * share));  // filters have gradual edges
}

void Texture::render(double from_m_s, double to_m_s, double rate_hz, const Gains& from, const Gains& to,
                     std::array<float, kSubBlock + 1>& height_m) noexcept {
  const Tables& tables = get_tables();
  height_m.fill(0.0F);
  std::array<std::uint64_t, kSubBlock + 1> place;
  const double turns_per_m = 1.0 / (kLongestM * kWaves);
  for (int n = 0; n <= kSubBlock; ++n) {
    const double t = n, way_m = (from_m_s * t + (to_m_s - from_m_s) * t * t / (2.0 * kSubBlock)) / rate_hz;
    place[n] = place_ + to_place(way_m * turns_per_m);
  }
  place_ = place.back();
  for (std::size_t octave = 0; octave < kOctaves; ++octave) {
    const float first = from.height_m[octave], step = (to.height_m[octave] - first) / kSubBlock;
    if (first == 0.0F && to.height_m[octave] == 0.0F) continue;
    for (std::size_t n = 0; n <= kSubBlock; ++n) {
      const std::uint64_t at = (place[n] << octave) + offset_[octave];
      const float* c = tables.coefficient.data() + (at >> (64 - kBits));
      const float t = static_cast<float>(static_cast<std::int32_t>((at >> (40 - kBits)) & 0xffffff)) * kFraction;
      const float s = 1.0F - t;
      const float spline = c[0] * (s * s * s) + c[1] * (4.0F - 6.0F * t * t + 3.0F * t * t * t) +
                           c[2] * (4.0F - 6.0F * s * s + 3.0F * s * s * s) + c[3] * (t * t * t);
      height_m[n] += (first + step * static_cast<float>(n)) * spline * (1.0F / 6.0F);
    }
  }
}

}  // namespace carillon::synth
