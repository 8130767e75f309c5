// Method:     the retarded time t' = t - r(t') / c is found by Newton's method at the borders of quanta; between them delay, 1 / r and
// direction
//             are cubic in the time of arrival, with their true slopes at both ends. Where nothing moves they stay what they are, and the
//             32 samples of a quantum are one convolution. The pressure at t' is read with a Kaiser-windowed sinc
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

constexpr int kQuantum = Ear::kQuantum;
constexpr int kPhases = 512;
constexpr double kFarthest = 1e12;   // samples; keeps what follows within integers
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

/// As read() for samples in a row that come by one phase, with sums of another order. False when all are silence.
bool read_row(const History& sent, std::int64_t first, const Taps& taps, std::span<float> row) noexcept {
  const float* samples = sent.find(first, kTaps + static_cast<std::int64_t>(row.size()) - 1);
  if (samples == nullptr && row.size() > 1) {  // at one of the ends
    bool heard = false;
    for (std::size_t i = 0; i < row.size(); ++i) {
      row[i] = 0.0F;
      heard = read_row(sent, first + static_cast<std::int64_t>(i), taps, row.subspan(i, 1)) || heard;
    }
    return heard;
  }
  if (samples == nullptr) return false;
  if (row.size() == kQuantum) {
    std::array<float, kQuantum> sum{};
    for (int tap = 0; tap < kTaps; ++tap) {
#pragma GCC unroll 32
      for (int i = 0; i < kQuantum; ++i) sum[i] += taps[tap] * samples[tap + i];
    }
    std::copy(sum.begin(), sum.end(), row.begin());
    return true;
  }
  std::fill(row.begin(), row.end(), 0.0F);
  for (int tap = 0; tap < kTaps; ++tap) {
    for (std::size_t i = 0; i < row.size(); ++i) row[i] += taps[tap] * samples[tap + static_cast<int>(i)];
  }
  return true;
}

/// Whether a build and an ear have an effect.
constexpr bool has(EffectSet effects, Effect effect) { return kCompiledEffects.has(effect) && effects.has(effect); }

/// The way of a sound that takes no time.
Way calc_straight_way(const Track& source, const Track& listener, const Vec3& offset_m, double time_s) noexcept {
  const Waypoint here = listener.find(time_s), there = source.find(time_s);
  Way way;
  Vec3 change{};
  for (std::size_t k = 0; k < 3; ++k) {
    way.direction[k] = here.position_m[k] + offset_m[k] - there.position_m[k];
    change[k] = here.velocity_m_s[k] - there.velocity_m_s[k];
  }
  const double exact = std::sqrt(calc_dot(way.direction, way.direction)), distance = std::max(exact, kNearestM);
  for (double& x : way.direction) x = exact > 0.0 ? x / exact : 0.0;
  way.spreading_1_m = 1.0 / distance;
  if (exact < kNearestM) return way;
  const double stretch = calc_dot(way.direction, change);
  way.spreading_slope = -stretch / (distance * distance);
  for (std::size_t k = 0; k < 3; ++k) way.direction_slope[k] = (change[k] - way.direction[k] * stretch) / distance;
  return way;
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

void Ear::begin(const Source& source, const Track& listener, std::int64_t sample) noexcept {
  if (!has(effects_, Effect::kAirDelay)) return;
  first_delay_s_ = calc_way(*source.track, listener, offset_m_, static_cast<double>(sample - kLatency) / rate_hz_).delay_s;
  is_placed_ = true;
}

double Ear::calc_delay_s(const Source& source, const Track& listener, std::int64_t sample) const noexcept {
  if (!has(effects_, Effect::kAirDelay)) return 0.0;
  if (!has(effects_, Effect::kDoppler) && is_placed_) return first_delay_s_;
  return calc_way(*source.track, listener, offset_m_, static_cast<double>(sample - kLatency) / rate_hz_).delay_s;
}

/// Of what arrives at a border of quanta, with the effects that this ear has.
Way Ear::find_way(const Source& source, const Track& listener, std::int64_t border, double& travel_s) noexcept {
  const double arrival_s = static_cast<double>(border * kQuantum - kLatency) / rate_hz_;
  travel_s = 0.0;
  if (!has(effects_, Effect::kAirDelay)) return calc_straight_way(*source.track, listener, offset_m_, arrival_s);
  Way way = calc_way(*source.track, listener, offset_m_, arrival_s);
  travel_s = way.delay_s;
  if (!is_placed_) first_delay_s_ = way.delay_s;
  is_placed_ = true;
  if (!has(effects_, Effect::kDoppler)) {
    way.delay_s = first_delay_s_;
    way.delay_slope = 0.0;
  }
  return way;
}

void Ear::find_ways(const Source& source, const Track& listener, std::int64_t quantum) noexcept {
  if (quantum_ >= 0 && quantum == quantum_ + 1)
    from_ = to_;
  else
    from_ = find_way(source, listener, quantum, travel_s_);
  quantum_ = quantum;
  // Where nothing has moved since this was sent, nothing changes until the end.
  const double arrival_s = static_cast<double>(quantum * kQuantum - kLatency) / rate_hz_;
  const bool rests = from_.delay_slope == 0.0 && from_.spreading_slope == 0.0 && source.track->is_still_from(arrival_s - travel_s_) &&
                     listener.is_still_from(arrival_s);
  to_ = rests ? from_ : find_way(source, listener, quantum + 1, travel_s_);
}

int Ear::process(const Source& source, const Track& listener, std::int64_t sample, std::span<double> received_pa) noexcept {
  int moved = 0;
  while (!received_pa.empty()) {
    if (sample / kQuantum != quantum_) find_ways(source, listener, sample / kQuantum);
    const auto left = static_cast<std::size_t>(kQuantum - sample % kQuantum);
    const auto piece = received_pa.first(std::min(left, received_pa.size()));
    if (from_.delay_s == to_.delay_s && from_.delay_slope == 0.0 && to_.delay_slope == 0.0) {
      process_still(source, sample, piece);
    } else {
      process_moving(source, sample, piece);
      moved += static_cast<int>(piece.size());
    }
    sample += static_cast<std::int64_t>(piece.size());
    received_pa = received_pa.subspan(piece.size());
  }
  return moved;
}

void Ear::process_still(const Source& source, std::int64_t sample, std::span<double> received_pa) noexcept {
  const double delay = rate_hz_ * from_.delay_s + kLatency;
  if (!(delay < kFarthest)) return;
  const double whole = std::ceil(delay);
  const std::int64_t first = sample - static_cast<std::int64_t>(whole) - kTaps / 2 + 1;
  const auto count = static_cast<int>(received_pa.size());
  if (whole - delay != phase_) {
    phase_ = whole - delay;
    taps_ = calc_taps(phase_);
  }
  const double width_s = kQuantum / rate_hz_;
  const auto get_u = [sample](int i) { return static_cast<double>((sample + i) % kQuantum) / kQuantum; };
  std::array<double, kQuantum> sum{};
  bool heard = false;
  for (std::size_t source_part = 0; source_part < 4; ++source_part) {
    const History* sent = source_part == 0 ? source.monopole : source.dipole[source_part - 1];
    if (sent == nullptr || sent->is_silent()) continue;
    std::array<float, kQuantum> part;
    if (!read_row(*sent, first, taps_, std::span(part).first(received_pa.size()))) continue;
    heard = true;
    if (source_part == 0) {
      for (int i = 0; i < count; ++i) sum[i] += static_cast<double>(part[i]);
      continue;
    }
    const std::size_t k = source_part - 1;
    for (int i = 0; i < count; ++i) {
      sum[i] += static_cast<double>(part[i]) * interpolate(from_.direction[k], from_.direction_slope[k] * width_s, to_.direction[k],
                                                           to_.direction_slope[k] * width_s, get_u(i));
    }
  }
  if (!heard) return;
  if (from_.spreading_1_m == to_.spreading_1_m && from_.spreading_slope == 0.0 && to_.spreading_slope == 0.0) {
    for (int i = 0; i < count; ++i) received_pa[i] += sum[i] * from_.spreading_1_m;
    return;
  }
  for (int i = 0; i < count; ++i) {
    received_pa[i] += sum[i] * interpolate(from_.spreading_1_m, from_.spreading_slope * width_s, to_.spreading_1_m,
                                           to_.spreading_slope * width_s, get_u(i));
  }
}

void Ear::process_moving(const Source& source, std::int64_t sample, std::span<double> received_pa) const noexcept {
  const double width_s = kQuantum / rate_hz_;
  double row_phase = -1.0;
  Taps taps{};
  for (std::size_t i = 0; i < received_pa.size(); ++i) {
    const std::int64_t n = sample + static_cast<std::int64_t>(i);
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
