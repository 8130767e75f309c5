// Ten minutes of ringing against the closed form, for every instruction set: pitch, level and residual.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include "runtime/synth/resonator_bank.hpp"
#include "tests/unit/runtime/synth/cube_bank.hpp"

namespace carillon::synth {
namespace {

using std::numbers::pi;
constexpr double kRate = 48000.0;
constexpr std::int64_t kMinutes = 10;
constexpr int kSeen = 96000;  // samples at the end that are looked at: two seconds

/// Result at the end of a sinusoid that began with q' = 1, against 1 cos(...).
struct Fit {
  double level_db, cents, residual_db;
};

/// Least squares of exp(-d t) times cosine and sine of the known frequency, over two halves: their phases give the frequency.
Fit fit(const std::vector<float>& seen, std::int64_t from, double freq_hz, double decay) {
  const long double omega_d =
      std::sqrt(4.0L * std::numbers::pi_v<long double> * std::numbers::pi_v<long double> * freq_hz * freq_hz - decay * decay);
  const auto solve = [&](int first, int last) {
    long double cc = 0, cs = 0, ss = 0, cy = 0, sy = 0;
    for (int n = first; n < last; ++n) {
      const long double t = static_cast<long double>(from + n) / kRate;
      const long double size = std::exp(-static_cast<long double>(decay) * t);
      const long double phase = std::remainder(omega_d * t, 2.0L * std::numbers::pi_v<long double>);
      // As q' of the closed form, and in quadrature with it.
      const long double c = size * (std::cos(phase) - decay / omega_d * std::sin(phase)), s = size * std::sin(phase);
      cc += c * c, cs += c * s, ss += s * s, cy += c * seen[n], sy += s * seen[n];
    }
    const long double det = cc * ss - cs * cs;
    return std::array<double, 2>{static_cast<double>((cy * ss - sy * cs) / det), static_cast<double>((sy * cc - cy * cs) / det)};
  };
  const auto whole = solve(0, kSeen);
  double rest = 0.0, total = 0.0;
  for (int n = 0; n < kSeen; ++n) {
    const long double t = static_cast<long double>(from + n) / kRate;
    const long double size = std::exp(-static_cast<long double>(decay) * t);
    const long double phase = std::remainder(omega_d * t, 2.0L * std::numbers::pi_v<long double>);
    const double model =
        static_cast<double>(size * (whole[0] * (std::cos(phase) - decay / omega_d * std::sin(phase)) + whole[1] * std::sin(phase)));
    rest += (seen[n] - model) * (seen[n] - model);
    total += model * model;
  }
  // A wrong frequency has turned the phase away from that of the closed form by the end.
  const double turned = std::atan2(whole[1], whole[0]) / (2.0 * pi);
  const double seconds = static_cast<double>(from + kSeen / 2) / kRate;
  return {20.0 * std::log10(std::hypot(whole[0], whole[1])), 1200.0 * std::log2(1.0 + std::abs(turned) / seconds / freq_hz),
          10.0 * std::log10(rest / total)};
}

TEST(Accuracy, TenMinutesAreInTuneAndOnLevel) {
  const std::vector<double> freqs{20.0, 100.0, 440.0, 1000.0, 1500.01, 6000.0, 20000.0, 0.499 * kRate};
  for (const Isa isa : {Isa::kSse4, Isa::kAvx2, Isa::kBest}) {
    if (isa != Isa::kBest && get_kernels(isa).isa != isa) continue;
    for (const double decay : {0.0, 0.01, 1.0}) {
      // With 1 / s nothing is left after ten minutes: the end is then where it is 60 dB down.
      const std::int64_t samples = decay > 0.5 ? static_cast<std::int64_t>(7.0 * kRate) : kMinutes * 60 * static_cast<std::int64_t>(kRate);
      for (const double freq : freqs) {
        ResonatorBank voice(Model::make(testing::make_cube_bank({{freq, decay}}), {.rate_hz = kRate}), {.silence_pa = 1e-30, .isa = isa});
        ASSERT_TRUE(voice.strike({.impulse_n_s = {0.0, 0.0, 1.0}}));
        std::vector<float> seen(kSeen, 0.0F), block(48000);
        for (std::int64_t n = 0; n < samples - kSeen; n += 48000) voice.process(block);
        voice.process(seen);
        const Fit got = fit(seen, samples - kSeen, freq, decay);
        EXPECT_LT(std::abs(got.level_db), 0.01) << freq << " Hz, " << decay << " / s, " << get_name(isa);
        EXPECT_LT(got.cents, 0.01) << freq << " Hz, " << decay << " / s, " << get_name(isa);
        EXPECT_LT(got.residual_db, -120.0) << freq << " Hz, " << decay << " / s, " << get_name(isa);
      }
    }
  }
}

}  // namespace
}  // namespace carillon::synth
