// Method:     the emission time t' = t - r(t') / c by Newton's method at the borders of sub-blocks; in between delay, 1 / r and direction
//             are cubic in the arrival time, with exact slopes at both ends. The pressure at t' is read with a Kaiser-windowed sinc from a
//             table of phases (kernels_receiver.inl). At rest the 32 samples of a sub-block are one convolution. A smoothly changing delay
//             is the Doppler shift.
// Source:     OCE01 section 4 (delay r / c and 1 / r); Kaiser 1974 (window); Morse & Ingard 1968, 11.2: a moving source of the pressure p
//             at 1 m is heard with p / (r (1 - M)^2), M = v.r / r c at emission; docs/equations.md.
// Deviations: OCE01 splats every sample into two neighbours with a Gaussian, which costs 2 to 9 dB at 10 kHz; this is flat to 0.4 of the
//             rate. The source is at the centre of mass; the near field of moving sources and dipoles is left out: v / (2 pi f r) and c /
//             (2 pi f r) of the level.
#include "runtime/synth/receiver.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "runtime/acoustics/radiation/transfers.hpp"
#include "runtime/base/sinc.hpp"
#include "runtime/base/vector.hpp"

namespace carillon::synth {
namespace {

constexpr int kPhases = base::kSincPhases;
constexpr double kFarthest = 1e12;  // samples; keeps the following within integers
using Taps = std::array<float, kTaps>;
static_assert(kTaps == base::kSincTaps);

/// Convolves at most a sub-block with constant taps. False for silence.
bool read_row(const Kernels& kernels, const DelayLine& sent, std::int64_t first, const Taps& taps, std::span<float> row) noexcept {
  const std::int64_t count = kTaps + static_cast<std::int64_t>(row.size()) - 1;
  const float* samples = sent.find(first, count);
  if (samples != nullptr && row.size() == kSubBlock) {
    kernels.convolve(taps.data(), samples, row.data());
    return true;
  }
  // Less than a sub-block, or at an end of the emitted samples: the same sums over a zero-padded copy.
  std::array<float, kTaps + kSubBlock> copy{};
  bool heard = samples != nullptr;
  for (std::int64_t i = 0; i < count; ++i) {
    const float* one = samples != nullptr ? samples + i : sent.find(first + i, 1);
    if (one == nullptr) continue;
    copy[i] = *one;
    heard = true;
  }
  if (!heard) return false;
  std::array<float, kSubBlock> whole;
  kernels.convolve(taps.data(), copy.data(), whole.data());
  std::copy_n(whole.begin(), row.size(), row.begin());
  return true;
}

/// Path without travel time.
PathState calc_straight_way(const Trajectory& source, const Trajectory& listener, const Vec3& offset_m, double time_s) noexcept {
  const Waypoint here = listener.find(time_s), there = source.find(time_s);
  PathState way;
  Vec3 change{};
  for (std::size_t k = 0; k < 3; ++k) {
    way.direction[k] = here.position_m[k] + offset_m[k] - there.position_m[k];
    change[k] = here.velocity_m_s[k] - there.velocity_m_s[k];
  }
  const double exact = std::sqrt(dot(way.direction, way.direction)), distance = std::max(exact, kNearestM);
  for (double& x : way.direction) x = exact > 0.0 ? x / exact : 0.0;
  way.spreading_1_m = 1.0 / distance;
  if (exact < kNearestM) return way;
  const double stretch = dot(way.direction, change);
  way.spreading_slope = -stretch / (distance * distance);
  for (std::size_t k = 0; k < 3; ++k) way.direction_slope[k] = (change[k] - way.direction[k] * stretch) / distance;
  return way;
}

}  // namespace

PathState calc_path_state(const Trajectory& source, const Trajectory& listener, const Vec3& offset_m, double time_s) noexcept {
  constexpr int kSteps = 20;  // four suffice for falling bodies; more near the speed of sound
  const Waypoint here = listener.find(time_s);
  double emission = time_s;
  PathState way;
  double distance = 0.0;
  Vec3 velocity{};
  bool near = false;
  for (int step = 0; step < kSteps; ++step) {
    const Waypoint there = source.find(emission);
    velocity = there.velocity_m_s;
    for (std::size_t k = 0; k < 3; ++k) way.direction[k] = here.position_m[k] + offset_m[k] - there.position_m[k];
    distance = std::sqrt(dot(way.direction, way.direction));
    for (double& x : way.direction) x = distance > 0.0 ? x / distance : 0.0;
    near = distance < kNearestM;
    distance = std::max(distance, kNearestM);
    const double late = emission + distance / kSoundSpeedMs - time_s;
    if (std::abs(late) < 1e-12) break;
    const double slope = near ? 1.0 : 1.0 - dot(way.direction, velocity) / kSoundSpeedMs;
    emission = std::min(time_s, emission - late / std::max(slope, 0.05));
  }
  const double approach = near ? 0.0 : dot(way.direction, velocity) / kSoundSpeedMs;
  const double leave = near ? 0.0 : dot(way.direction, here.velocity_m_s) / kSoundSpeedMs;
  const double pace = (1.0 - leave) / std::max(1.0 - approach, 0.05);  // emission time per arrival time
  Vec3 change{};
  for (std::size_t k = 0; k < 3; ++k) change[k] = here.velocity_m_s[k] - velocity[k] * pace;
  const double stretch = near ? 0.0 : dot(way.direction, change);
  way.convection = 1.0 / std::max(1.0 - approach, 0.05);
  way.delay_s = time_s - emission;
  way.delay_slope = near ? 0.0 : 1.0 - pace;
  way.spreading_1_m = 1.0 / distance;
  way.spreading_slope = -stretch / (distance * distance);
  for (std::size_t k = 0; k < 3; ++k) way.direction_slope[k] = near ? 0.0 : (change[k] - way.direction[k] * stretch) / distance;
  way.convection_slope = way.convection * way.convection * dot(way.direction_slope, velocity) / kSoundSpeedMs;
  return way;
}

Cubic Cubic::make(double a, double slope_a, double b, double slope_b) noexcept {
  constexpr double kUnit = 1.0 / kSubBlock;
  return {{a, slope_a * kUnit, (3.0 * (b - a) - 2.0 * slope_a - slope_b) * kUnit * kUnit,
           (2.0 * (a - b) + slope_a + slope_b) * kUnit * kUnit * kUnit}};
}

void Cubic::evaluate(int first, std::span<double> out) const noexcept {
  for (std::size_t i = 0; i < out.size(); ++i) {
    const double x = first + static_cast<int>(i);
    out[i] = power[0] + x * (power[1] + x * (power[2] + x * power[3]));
  }
}

Receiver::Receiver(const Vec3& offset_m, double sample_rate_hz, EffectSet effects, Isa isa, double sphere_m, int more_latency)
    : offset_m_(offset_m),
      rate_hz_(sample_rate_hz),
      effects_(effects),
      kernels_(&get_kernels(isa)),
      sphere_m_(sphere_m),
      latency_(kLatency + more_latency) {
  base::Sinc::get();  // built here, not in process()
}

/// Path of the sound arriving at a time; from the sphere, if any.
PathState Receiver::calc_way(const Source& source, const Trajectory& listener, double time_s) const noexcept {
  PathState way = effects_.has(Effect::kAirDelay) ? calc_path_state(*source.track, listener, offset_m_, time_s)
                                                  : calc_straight_way(*source.track, listener, offset_m_, time_s);
  if (sphere_m_ == 0.0) return way;
  way.spreading_1_m = 1.0;
  way.spreading_slope = 0.0;
  if (!effects_.has(Effect::kAirDelay)) return way;
  way.delay_s -= sphere_m_ / kSoundSpeedMs;
  if (const double least_s = (radiation::kNearestRadii - 1.0) * sphere_m_ / kSoundSpeedMs; way.delay_s < least_s) {
    way.delay_s = least_s;
    way.delay_slope = 0.0;
  }
  return way;
}

void Receiver::begin(const Source& source, const Trajectory& listener, std::int64_t sample) noexcept {
  if (!effects_.has(Effect::kAirDelay)) return;
  first_delay_s_ = calc_way(source, listener, static_cast<double>(sample - latency_) / rate_hz_).delay_s;
  is_placed_ = true;
}

/// Path at a border of sub-blocks, with this ear's effects.
PathState Receiver::find_path_state(const Source& source, const Trajectory& listener, std::int64_t border, double& travel_s) noexcept {
  const double arrival_s = static_cast<double>(border * kSubBlock - latency_) / rate_hz_;
  travel_s = 0.0;
  PathState way = calc_way(source, listener, arrival_s);
  if (!effects_.has(Effect::kAirDelay)) return way;
  travel_s = way.delay_s + sphere_m_ / kSoundSpeedMs;
  if (!is_placed_) first_delay_s_ = way.delay_s;
  is_placed_ = true;
  if (!effects_.has(Effect::kDoppler)) {
    way.delay_s = first_delay_s_;
    way.delay_slope = 0.0;
    return way;
  }
  // Level times (1 - M)^-2; for a dipole, two adjacent sources one of which is heard 1 / (1 - M) times as much later, (1 - M)^-3.
  const double more = way.convection, more_slope = way.convection_slope;
  way.spreading_slope = more * (more * way.spreading_slope + 2.0 * more_slope * way.spreading_1_m);
  way.spreading_1_m *= more * more;
  for (std::size_t k = 0; k < 3; ++k) {
    way.direction_slope[k] = more * way.direction_slope[k] + more_slope * way.direction[k];
    way.direction[k] *= more;
  }
  return way;
}

void Receiver::find_path_states(const Source& source, const Trajectory& listener, std::int64_t sub_block) noexcept {
  if (sub_block_ >= 0 && sub_block == sub_block_ + 1)
    from_ = to_;
  else
    from_ = find_path_state(source, listener, sub_block, travel_s_);
  sub_block_ = sub_block;
  // If nothing moves after the emission, the path is constant to the end.
  const double arrival_s = static_cast<double>(sub_block * kSubBlock - latency_) / rate_hz_;
  // After a jump the path to the old place still changes for its travel time.
  constexpr double kLongestTravelS = 300.0;  // of 100 km
  const bool has_jumped = source.track->is_cut(arrival_s - kLongestTravelS, arrival_s);
  const bool rests = !has_jumped && from_.delay_slope == 0.0 && from_.spreading_slope == 0.0 &&
                     source.track->is_still_from(arrival_s - travel_s_) && listener.is_still_from(arrival_s);
  const double begin_travel_s = travel_s_;
  to_ = rests ? from_ : find_path_state(source, listener, sub_block + 1, travel_s_);
  // After a jump away from the ear nothing arrives for a while: the emission may then be on either side of the cut.
  const auto [least_s, most_s] = std::minmax(begin_travel_s, travel_s_);
  is_cut_ = !rests && source.track->is_cut(arrival_s - most_s, arrival_s + kSubBlock / rate_hz_ - least_s);
  set_path(from_, to_);
}

void Receiver::set_path(const PathState& from, const PathState& to) noexcept {
  const double width_s = kSubBlock / rate_hz_;
  delay_ = Cubic::make(rate_hz_ * from.delay_s + latency_, kSubBlock * from.delay_slope, rate_hz_ * to.delay_s + latency_,
                       kSubBlock * to.delay_slope);
  spreading_ = Cubic::make(from.spreading_1_m, width_s * from.spreading_slope, to.spreading_1_m, width_s * to.spreading_slope);
  for (std::size_t k = 0; k < 3; ++k) {
    direction_[k] = Cubic::make(from.direction[k], width_s * from.direction_slope[k], to.direction[k], width_s * to.direction_slope[k]);
  }
}

int Receiver::process(const Source& source, const Trajectory& listener, std::int64_t sample, std::span<double> received_pa) noexcept {
  int moved = 0;
  while (!received_pa.empty()) {
    if (sample / kSubBlock != sub_block_) find_path_states(source, listener, sample / kSubBlock);
    const std::size_t left = kSubBlock - sample % kSubBlock;
    const auto piece = received_pa.first(std::min(left, received_pa.size()));
    if (!delay_.is_constant()) moved += static_cast<int>(piece.size());
    if (is_cut_)
      process_cut(source, sample, piece);
    else
      process_piece(source, sample, piece);
    sample += static_cast<std::int64_t>(piece.size());
    received_pa = received_pa.subspan(piece.size());
  }
  return moved;
}

void Receiver::process_piece(const Source& source, std::int64_t sample, std::span<double> received_pa) noexcept {
  if (delay_.is_constant())
    process_still(source, sample, received_pa);
  else
    process_moving(source, sample, received_pa);
}

/// From the old to the new path without one in between, whose changing delay would be a chirp.
void Receiver::process_cut(const Source& source, std::int64_t sample, std::span<double> received_pa) noexcept {
  const auto hold = [](PathState path) {
    path.delay_slope = path.spreading_slope = 0.0;
    path.direction_slope = {};
    return path;
  };
  std::array<double, kSubBlock> before{}, after{};
  const std::size_t count = received_pa.size();
  set_path(hold(from_), hold(from_));
  process_piece(source, sample, std::span(before).first(count));
  set_path(hold(to_), hold(to_));
  process_piece(source, sample, std::span(after).first(count));
  set_path(from_, to_);
  for (std::size_t i = 0; i < count; ++i) {
    const double share = (static_cast<double>(sample % kSubBlock) + static_cast<double>(i) + 0.5) / kSubBlock;
    received_pa[i] += (1.0 - share) * before[i] + share * after[i];
  }
}

void Receiver::process_still(const Source& source, std::int64_t sample, std::span<double> received_pa) noexcept {
  const double delay = delay_.power[0];
  if (!(delay < kFarthest)) return;
  const double whole = std::ceil(delay);
  const std::int64_t first = sample - static_cast<std::int64_t>(whole) - kTaps / 2 + 1;
  if (whole - delay != phase_) {
    phase_ = whole - delay;
    base::Sinc::get().make_delay(phase_, taps_);
  }
  const auto begin = static_cast<int>(sample % kSubBlock);
  const std::size_t count = received_pa.size();
  std::array<double, kSubBlock> sum{}, factor;
  bool heard = false;
  for (std::size_t part = 0; part < 4; ++part) {
    const DelayLine* sent = part == 0 ? source.monopole : source.dipole[part - 1];
    if (sent == nullptr || sent->is_silent()) continue;
    std::array<float, kSubBlock> row;
    if (!read_row(*kernels_, *sent, first, taps_, std::span(row).first(count))) continue;
    heard = true;
    if (part == 0) {
      for (std::size_t i = 0; i < count; ++i) sum[i] += static_cast<double>(row[i]);
      continue;
    }
    direction_[part - 1].evaluate(begin, std::span(factor).first(count));
    for (std::size_t i = 0; i < count; ++i) sum[i] += static_cast<double>(row[i]) * factor[i];
  }
  if (!heard) return;
  spreading_.evaluate(begin, std::span(factor).first(count));
  for (std::size_t i = 0; i < count; ++i) received_pa[i] += sum[i] * factor[i];
}

void Receiver::process_moving(const Source& source, std::int64_t sample, std::span<double> received_pa) const noexcept {
  const auto begin = static_cast<int>(sample % kSubBlock);
  const std::size_t count = received_pa.size();
  std::array<double, kSubBlock> delay, spreading;
  delay_.evaluate(begin, std::span(delay).first(count));
  spreading_.evaluate(begin, std::span(spreading).first(count));
  // First tap and phase of each sample.
  std::array<std::int64_t, kSubBlock> first;
  std::array<Reading, kSubBlock> readings;
  std::int64_t lowest = std::numeric_limits<std::int64_t>::max(), highest = std::numeric_limits<std::int64_t>::min();
  const float* table = base::Sinc::get().get_taps(0);
  for (std::size_t i = 0; i < count; ++i) {
    readings[i].sources = 0;
    if (!(delay[i] < kFarthest)) return;
    auto whole = static_cast<std::int64_t>(delay[i]);
    whole += static_cast<double>(whole) < delay[i] ? 1 : 0;
    const double scaled = (static_cast<double>(whole) - delay[i]) * kPhases;
    const int phase = std::min(static_cast<int>(scaled), kPhases - 1);
    readings[i].taps = table + phase * kTaps;
    readings[i].mix = static_cast<float>(scaled - phase);
    first[i] = sample + static_cast<std::int64_t>(i) - whole - kTaps / 2 + 1;
    lowest = std::min(lowest, first[i]);
    highest = std::max(highest, first[i]);
  }
  for (std::size_t part = 0; part < 4; ++part) {
    const DelayLine* sent = part == 0 ? source.monopole : source.dipole[part - 1];
    if (sent == nullptr || sent->is_silent()) continue;
    std::array<double, kSubBlock> weight;
    if (part > 0) direction_[part - 1].evaluate(begin, std::span(weight).first(count));
    const std::int64_t range = highest - lowest + kTaps;
    const float* row = range <= sent->get_longest_row() ? sent->find(lowest, range) : nullptr;
    for (std::size_t i = 0; i < count; ++i) {
      const float* samples = row != nullptr ? row + (first[i] - lowest) : sent->find(first[i]);
      if (samples == nullptr) continue;
      Reading& reading = readings[i];
      reading.source[reading.sources] = samples;
      reading.weight[reading.sources++] = part == 0 ? 1.0F : static_cast<float>(weight[i]);
    }
  }
  std::array<float, kSubBlock> heard;
  kernels_->read(readings.data(), static_cast<int>(count), heard.data());
  for (std::size_t i = 0; i < count; ++i) received_pa[i] += static_cast<double>(heard[i]) * spreading[i];
}

}  // namespace carillon::synth
