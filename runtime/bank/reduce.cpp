// Method: a mode with pressure p at 1 m after a blow and decay d has the exposure p^2 / (2 (2 d + 1 / T)) within the ear's time constant T.
//   Modes are ranked by it, squared shapes averaged over the surface; ties keep the frequency order. The blow's spectrum is a Gaussian with
//   the variance of a Hertz pulse, without zeros that would favour one mode over another.
// Source: A-weighting: IEC 61672-1:2013, E.4.2; T: Zwislocki 1969.
// Deviations: no masking between modes; the bank's gains neglect cancellation (docs/decisions/radiation-gain.md).
#include "runtime/bank/reduce.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "runtime/bank/select.hpp"
#include "runtime/bank/surface.hpp"
#include "runtime/base/sort_order.hpp"

namespace carillon::bank {
namespace {

constexpr double kBlowS = 1e-4;  // hard contact of hand-held bodies
/// Trigamma function at 7/4: the Fourier transform of sin^1.5 falls initially as exp(-kCurvature (f tau)^2).
constexpr double kCurvature = 0.76410187;

/// Mean over the outer surface of (phi . n)^2 of every mode, (m) [1/kg].
std::vector<double> calc_mean_squares(const Bank& bank) {
  std::vector<double> sums(bank.mode_count(), 0.0);
  double area = 0.0;
  for (const Triangle& triangle : find_outer_triangles(bank.vertices_m, bank.triangles)) {
    const Vec3 normal = calc_normal(bank.vertices_m, triangle);
    const double size = calc_length(normal);
    if (!(size > 0.0)) continue;
    area += size;
    for (const std::int32_t vertex : triangle) {
      const std::int16_t* row = bank.get_steps(static_cast<std::size_t>(vertex));
      for (std::size_t m = 0; m < bank.mode_count(); ++m, row += 3) {
        const double steps = (row[0] * normal[0] + row[1] * normal[1] + row[2] * normal[2]) / size;
        sums[m] += size * steps * steps / 3.0;
      }
    }
  }
  for (std::size_t m = 0; m < sums.size(); ++m) sums[m] *= area > 0.0 ? bank.shape_scale[m] * bank.shape_scale[m] / area : 0.0;
  return sums;
}

/// Keeps the `count` most audible modes, in ascending order.
void keep_loudest(Bank& bank, std::size_t count) {
  std::vector<double> silence = calc_audibility(bank);
  for (double& audibility : silence) audibility = -audibility;
  std::vector<std::size_t> kept = base::find_sort_order(silence);
  kept.resize(count);
  std::sort(kept.begin(), kept.end());
  select_modes(bank, kept);
  bank.complete = false;
  bank.proof.reset();
}

void round_shapes(Bank& bank, int bits) {
  const int steps = (1 << (bits - 1)) - 1;
  const std::size_t modes = bank.mode_count();
  std::vector<int> largest(modes, 0);
  for (std::size_t i = 0; i < bank.shape.size(); ++i) {
    int& max = largest[i / 3 % modes];
    max = std::max(max, std::abs(static_cast<int>(bank.shape[i])));
  }
  for (std::size_t i = 0; i < bank.shape.size(); ++i) {
    const int max = largest[i / 3 % modes];
    if (max > steps) bank.shape[i] = find_step(bank.shape[i], static_cast<double>(max) / steps);
  }
  for (std::size_t m = 0; m < modes; ++m) {
    if (largest[m] > steps) bank.shape_scale[m] *= static_cast<double>(largest[m]) / steps;
  }
  if (bits <= 8) bank.shape_bytes = 1;
}

}  // namespace

double calc_a_weight(double freq_hz) noexcept {
  const double f2 = freq_hz * freq_hz;
  const double gain = 12194.217 * 12194.217 * f2 * f2 /
                      ((f2 + 20.598997 * 20.598997) * std::sqrt((f2 + 107.65265 * 107.65265) * (f2 + 737.86223 * 737.86223)) *
                       (f2 + 12194.217 * 12194.217));
  return 1.2589254 * gain;  // +2.000 dB
}

std::vector<double> calc_blow_exposure(const Bank& bank) {
  std::vector<double> exposure(bank.mode_count());
  for (std::size_t m = 0; m < exposure.size(); ++m) {
    const double cycles = bank.freq_hz(m) * kBlowS;
    const double pressure = calc_a_weight(bank.freq_hz(m)) * bank.radiation_gain[m] * std::exp(-kCurvature * cycles * cycles);
    exposure[m] = pressure * pressure / (2.0 * (2.0 * bank.decay_per_s[m] + 1.0 / kEarS));
  }
  return exposure;
}

std::vector<double> calc_audibility(const Bank& bank) {
  std::vector<double> audibility = calc_mean_squares(bank);
  const std::vector<double> exposure = calc_blow_exposure(bank);
  for (std::size_t m = 0; m < audibility.size(); ++m) audibility[m] *= exposure[m];
  return audibility;
}

Bank calc_reduced(const Bank& bank, const Reduction& reduction) {
  if (reduction.modes && *reduction.modes == 0) throw InputError("a bank of 0 modes is silent; keep 1 or more");
  if (reduction.shape_bits < kMinShapeBits || reduction.shape_bits > kMaxShapeBits) {
    throw InputError(fmt::format("shapes of {} bits; give {} to {}", reduction.shape_bits, kMinShapeBits, kMaxShapeBits));
  }
  Bank reduced = bank;
  reduced.packing.reset();
  if (const std::size_t count = reduction.modes.value_or(bank.mode_count()); count < bank.mode_count())
    reduction.keep == Keep::kLoudest ? keep_loudest(reduced, count) : keep_lowest(reduced, count);
  if (reduction.shape_bits < kMaxShapeBits) round_shapes(reduced, reduction.shape_bits);
  reduced.provenance = fmt::format(R"({{"reduced": {{"modes": {}, "of_modes": {}, "keep": "{}", "shape_bits": {}}})", reduced.mode_count(),
                                   bank.mode_count(), reduction.keep == Keep::kLoudest ? "loudest" : "lowest", reduction.shape_bits);
  reduced.provenance += bank.provenance.empty() ? "}" : fmt::format(R"(, "of": {}}})", bank.provenance);
  return reduced;
}

}  // namespace carillon::bank
