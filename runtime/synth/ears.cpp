// Method:     the retarded time t' = t - r(t') / c is found by Newton's method at the borders of quanta; between them delay, 1 / r and
// direction
//             are cubic in the time of arrival, with their true slopes at both ends. The pressure at t' is read with a Kaiser-windowed sinc
//             from a table of phases. A delay that changes smoothly is a Doppler shift, nothing else is needed.
// Source:     OCE01 section 4 (delay r / c and 1 / r); Kaiser 1974 (window); docs/equations.md.
// Deviations: OCE01 splats every sample into two neighbours with a Gaussian, which costs 2 to 9 dB at 10 kHz; this is flat to 0.4 of the
// rate.
//             The source is at the centre of mass; the factor 1 / (1 - v/c) of a moving monopole's level (0.05 dB at 2 m/s) is left out,
//             and of a dipole the near field.
#include "runtime/synth/ears.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

namespace carillon::synth {
namespace {

constexpr int kPhases = 512;
constexpr double kKaiserBeta = 9.0;  // stop band -90 dB
using Taps = std::array<float, kTaps>;

std::vector<Taps> make_sinc_table() {
  std::vector<Taps> table(kPhases + 1);
  const double half = kTaps / 2;
  for (int phase = 0; phase <= kPhases; ++phase) {
    std::array<double, kTaps> taps{};
    double total = 0.0;
    for (int tap = 0; tap < kTaps; ++tap) {
      // Tap `tap` sits at sample floor(t) - half + 1 + tap; x is its distance from t.
      const double x = tap - half + 1.0 - static_cast<double>(phase) / kPhases;
      const double sinc = x == 0.0 ? 1.0 : std::sin(std::numbers::pi * x) / (std::numbers::pi * x);
      const double w = std::max(0.0, 1.0 - (x / half) * (x / half));
      taps[tap] = sinc * std::cyl_bessel_i(0.0, kKaiserBeta * std::sqrt(w));
      total += taps[tap];
    }
    for (int tap = 0; tap < kTaps; ++tap) table[phase][tap] = static_cast<float>(taps[tap] / total);
  }
  return table;
}

const std::vector<Taps>& get_sinc_table() {
  static const std::vector<Taps> table = make_sinc_table();
  return table;
}

Taps calc_taps(double phase) noexcept {
  const double scaled = phase * kPhases;
  const int index = std::min(static_cast<int>(scaled), kPhases - 1);
  const auto mix = static_cast<float>(scaled - index);
  const Taps& a = get_sinc_table()[static_cast<std::size_t>(index)];
  const Taps& b = get_sinc_table()[static_cast<std::size_t>(index) + 1];
  Taps taps;
  for (int tap = 0; tap < kTaps; ++tap) taps[tap] = a[tap] + mix * (b[tap] - a[tap]);
  return taps;
}

double read(const float* samples, const Taps& taps) noexcept {
  constexpr int kLanes = 8;
  std::array<float, kLanes> sum{};
#pragma GCC unroll 4
  for (int tap = 0; tap < kTaps; tap += kLanes) {
#pragma GCC unroll 8
    for (int lane = 0; lane < kLanes; ++lane) sum[lane] += taps[tap + lane] * samples[tap + lane];
  }
  return static_cast<double>((sum[0] + sum[4]) + (sum[1] + sum[5])) + static_cast<double>((sum[2] + sum[6]) + (sum[3] + sum[7]));
}

double calc_dot(const Vec3& a, const Vec3& b) noexcept { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

/// Cubic between two values with slopes per unit of u, 0 <= u <= 1.
double interpolate(double a, double slope_a, double b, double slope_b, double u) noexcept {
  const double v = 1.0 - u;
  return a + u * u * (3.0 - 2.0 * u) * (b - a) + u * v * (v * slope_a - u * slope_b);
}

}  // namespace

Way calc_way(const Track& source, const Track& listener, const Vec3& offset_m, double time_s) noexcept {
  constexpr int kSteps = 20;  // four do for bodies that fall; more for those that leave at the speed of sound
  const Waypoint here = listener.find(time_s);
  double emission = time_s;
  Way way;
  double distance = 0.0;
  Vec3 velocity{};
  bool near = false;
  for (int step = 0; step < kSteps; ++step) {
    const Waypoint there = source.find(emission);
    velocity = there.velocity_m_s;
    for (std::size_t k = 0; k < 3; ++k) way.direction[k] = here.position_m[k] + offset_m[k] - there.position_m[k];
    distance = std::sqrt(calc_dot(way.direction, way.direction));
    for (double& x : way.direction) x = distance > 0.0 ? x / distance : 0.0;
    near = distance < kNearestM;
    distance = std::max(distance, kNearestM);
    const double late = emission + distance / kSoundSpeedMs - time_s;
    if (std::abs(late) < 1e-12) break;
    const double slope = near ? 1.0 : 1.0 - calc_dot(way.direction, velocity) / kSoundSpeedMs;
    emission = std::min(time_s, emission - late / std::max(slope, 0.05));
  }
  const double approach = near ? 0.0 : calc_dot(way.direction, velocity) / kSoundSpeedMs;
  const double leave = near ? 0.0 : calc_dot(way.direction, here.velocity_m_s) / kSoundSpeedMs;
  const double pace = (1.0 - leave) / std::max(1.0 - approach, 0.05);  // of the emission against the arrival
  Vec3 change{};
  for (std::size_t k = 0; k < 3; ++k) change[k] = here.velocity_m_s[k] - velocity[k] * pace;
  const double stretch = near ? 0.0 : calc_dot(way.direction, change);
  way.delay_s = time_s - emission;
  way.delay_slope = near ? 0.0 : 1.0 - pace;
  way.spreading_1_m = 1.0 / distance;
  way.spreading_slope = -stretch / (distance * distance);
  for (std::size_t k = 0; k < 3; ++k) way.direction_slope[k] = near ? 0.0 : (change[k] - way.direction[k] * stretch) / distance;
  return way;
}

Ear::Ear(const Vec3& offset_m, double sample_rate_hz, EffectSet effects)
    : offset_m_(offset_m), rate_hz_(sample_rate_hz), effects_(effects) {
  get_sinc_table();  // built here, not in process()
}

void Ear::find_ways(const Source& source, const Track& listener, std::int64_t quantum) noexcept {
  const auto find = [&](std::int64_t border) {
    Way way = calc_way(*source.track, listener, offset_m_, static_cast<double>(border * kQuantum - kLatency) / rate_hz_);
    if (quantum_ < 0) first_delay_s_ = way.delay_s;
    if (!effects_.has(Effect::kAirDelay) || !effects_.has(Effect::kDoppler)) {
      way.delay_s = effects_.has(Effect::kAirDelay) ? first_delay_s_ : 0.0;
      way.delay_slope = 0.0;
    }
    return way;
  };
  from_ = quantum_ >= 0 && quantum == quantum_ + 1 ? to_ : find(quantum);
  quantum_ = quantum;
  to_ = source.track->is_still() && listener.is_still() ? from_ : find(quantum + 1);
}

void Ear::process(const Source& source, const Track& listener, std::int64_t sample, std::span<double> received_pa) noexcept {
  constexpr double kFarthest = 1e12;  // samples; keeps what follows within integers
  const double width_s = kQuantum / rate_hz_;
  double row_phase = -1.0;
  Taps taps{};
  for (std::size_t i = 0; i < received_pa.size(); ++i) {
    const std::int64_t n = sample + static_cast<std::int64_t>(i);
    if (n / kQuantum != quantum_) find_ways(source, listener, n / kQuantum);
    const double u = static_cast<double>(n % kQuantum) / kQuantum;
    const double delay =
        rate_hz_ * interpolate(from_.delay_s, from_.delay_slope * width_s, to_.delay_s, to_.delay_slope * width_s, u) + kLatency;
    if (!(delay < kFarthest)) continue;
    const double whole = std::ceil(delay);
    const std::int64_t first = n - static_cast<std::int64_t>(whole) - kTaps / 2 + 1;
    std::array<const float*, 4> heard{source.monopole ? source.monopole->find(first) : nullptr};
    for (std::size_t k = 0; k < 3; ++k) heard[k + 1] = source.dipole[k] ? source.dipole[k]->find(first) : nullptr;
    if (!heard[0] && !heard[1] && !heard[2] && !heard[3]) continue;
    if (whole - delay != row_phase) {
      row_phase = whole - delay;
      taps = calc_taps(row_phase);
    }
    double pressure = heard[0] ? read(heard[0], taps) : 0.0;
    for (std::size_t k = 0; k < 3; ++k) {
      if (!heard[k + 1]) continue;
      pressure += read(heard[k + 1], taps) * interpolate(from_.direction[k], from_.direction_slope[k] * width_s, to_.direction[k],
                                                         to_.direction_slope[k] * width_s, u);
    }
    received_pa[i] +=
        pressure * interpolate(from_.spreading_1_m, from_.spreading_slope * width_s, to_.spreading_1_m, to_.spreading_slope * width_s, u);
  }
}

}  // namespace carillon::synth
