// Method:     the pole integrated over one sample against the interpolating sinc (runtime/base/sinc.hpp), by Simpson's rule on its table;
//             weights are scaled so that a constant g gives exactly the constant answer.
// Source:     docs/equations.md E14.
#include "runtime/acoustics/recording/pole.hpp"

#include <cmath>

#include "runtime/base/sinc.hpp"

namespace carillon::recording {

Pole make_pole(double radius_m, double sample_rate_hz, double sound_speed_m_s) {
  static_assert(kPoleTaps == base::kSincTaps);
  constexpr int kParts = 512;
  const base::Sinc& sinc = base::Sinc::get();
  const double step = 1.0 / sample_rate_hz;
  Pole pole;
  pole.rate_per_s = sound_speed_m_s / radius_m;
  pole.keep = std::exp(-pole.rate_per_s * step);
  double total = 0.0;
  for (int j = 0; j < kPoleTaps; ++j) {
    double sum = 0.0;
    for (int i = 0; i <= kParts; ++i) {
      const double at = static_cast<double>(i) / kParts;
      const double share = i == 0 || i == kParts ? 1.0 : (i % 2 == 1 ? 4.0 : 2.0);
      sum += share * std::exp(-pole.rate_per_s * step * (1.0 - at)) * sinc.evaluate(at - (j - base::kSincHalf + 1));
    }
    total += pole.weight[j] = sum;
  }
  for (double& weight : pole.weight) weight *= (1.0 - pole.keep) / pole.rate_per_s / total;
  return pole;
}

}  // namespace carillon::recording
