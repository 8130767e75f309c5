// Three blows in a row on a plate of steel, and the pitch that follows them.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "tests/unit/runtime/synth/nonlinear/bodies.hpp"

namespace carillon::nonlinear::bodies {

inline double decay_as_steel(double omega) { return 6.0 * (1.0 + 2e-8 * omega * omega); }

/// Frequencies of mode (1, 1) in windows of 0.1 s.
struct Glide {
  std::vector<double> window_hz;
  std::int64_t guarded = 0;
};

/// Three blows of 0.3 N s, of 1 ms, at 0, 0.4 and 0.8 s.
inline Glide strike_three_times(double rate_hz, const CoupledOptions& options) {
  const Plate plate;
  const Body body = plate.make(30, decay_as_steel);
  const std::vector<Plate::Number> numbers = plate.find_modes(30);
  CoupledModes modes(body.energy, body.modes, rate_hz, options);
  std::vector<double> re(30), im(30, 0.0);
  Glide glide;
  const auto window = static_cast<int>(std::lround(0.1 * rate_hz));
  double before = 0.0, first = -1.0, last = -1.0;
  int count = 0;
  const auto share = [](double t) {  // of the impulse, so long after its begin
    t = std::clamp(t / 1e-3, 0.0, 1.0);
    return t - std::sin(2.0 * kPi * t) / (2.0 * kPi);
  };
  for (int n = 1; n <= 16 * window; ++n) {
    const double t = n / rate_hz, since = t - 0.4 * std::min(2.0, std::floor((t - 1e-9) / 0.4));
    const double impulse = 0.3 * (share(since) - share(since - 1.0 / rate_hz));
    if (impulse > 0.0) {
      for (std::size_t i = 0; i < 30; ++i) re[i] = impulse * plate.calc_phi(numbers[i], 0.37 * plate.a_m, 0.41 * plate.b_m);
      modes.step(re, im);
    } else {
      modes.step();
    }
    const double q = modes.get_amplitude(0);
    if (before < 0.0 && q >= 0.0) {
      last = n - 1 + before / (before - q);
      if (count++ == 0) first = last;
    }
    before = q;
    if (n % window != 0) continue;
    glide.window_hz.push_back((count - 1) * rate_hz / (last - first));
    count = 0;
  }
  glide.guarded = modes.get_counters().guarded;
  return glide;
}

}  // namespace carillon::nonlinear::bodies
