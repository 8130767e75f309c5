// Method:     the retarded time t' = t - r(t') / c is found by fixed-point steps, which contract by v / c; the pressure at t' is read with
// a
//             Kaiser-windowed sinc from a table of phases. A delay that changes smoothly is a Doppler shift, nothing else is needed.
// Source:     OCE01 section 4 (delay r / c and 1 / r); Kaiser 1974 (window); docs/equations.md.
// Deviations: OCE01 splats every sample into two neighbours with a Gaussian, which costs 2 to 9 dB at 10 kHz; this is flat to 0.42 of the
// rate.
//             The source is a monopole at the centre of mass; the factor 1 / (1 - v/c) of a moving monopole's level (0.05 dB at 2 m/s) is
//             left out.
#include "runtime/synth/propagation.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numbers>

#include "runtime/config/error.hpp"

namespace carillon::synth {
namespace {

constexpr int kPhases = 512;
constexpr double kKaiserBeta = 8.0;  // stop band -80 dB
using Taps = std::array<double, Propagation::kTaps>;

std::vector<Taps> make_sinc_table() {
  std::vector<Taps> table(kPhases + 1);
  const double half = Propagation::kTaps / 2;
  for (int phase = 0; phase <= kPhases; ++phase) {
    double total = 0.0;
    for (int tap = 0; tap < Propagation::kTaps; ++tap) {
      // Tap `tap` sits at sample floor(t) - half + 1 + tap; x is its distance from t.
      const double x = tap - half + 1.0 - static_cast<double>(phase) / kPhases;
      const double sinc = x == 0.0 ? 1.0 : std::sin(std::numbers::pi * x) / (std::numbers::pi * x);
      const double w = std::max(0.0, 1.0 - (x / half) * (x / half));
      table[phase][tap] = sinc * std::cyl_bessel_i(0.0, kKaiserBeta * std::sqrt(w));
      total += table[phase][tap];
    }
    for (double& tap : table[phase]) tap /= total;
  }
  return table;
}

const std::vector<Taps>& get_sinc_table() {
  static const std::vector<Taps> table = make_sinc_table();
  return table;
}

}  // namespace

Path::Path(std::vector<Point> points) {
  for (const Point& point : points) {
    const bool finite = std::isfinite(point.time_s) && std::isfinite(point.position_m[0]) && std::isfinite(point.position_m[1]) &&
                        std::isfinite(point.position_m[2]);
    if (!finite || (!points_.empty() && point.time_s < points_.back().time_s)) {
      throw InputError("the path of a source must be finite and in order of time");
    }
    if (!points_.empty() && point.time_s == points_.back().time_s) points_.pop_back();
    points_.push_back(point);
  }
  if (points_.empty()) throw InputError("the path of a source needs at least one point");
  slope_m_s_.resize(points_.size());
  for (std::size_t i = 0; points_.size() > 1 && i < points_.size(); ++i) {
    const Point& before = points_[i == 0 ? 0 : i - 1];
    const Point& after = points_[std::min(i + 1, points_.size() - 1)];
    for (int k = 0; k < 3; ++k) slope_m_s_[i][k] = (after.position_m[k] - before.position_m[k]) / (after.time_s - before.time_s);
  }
}

Vec3 Path::find_position(double time_s, std::size_t& hint) const noexcept {
  if (points_.size() == 1 || !(time_s > points_.front().time_s)) return points_.front().position_m;
  if (time_s >= points_.back().time_s) return points_.back().position_m;
  std::size_t i = std::min(hint, points_.size() - 2);
  while (i > 0 && points_[i].time_s > time_s) --i;
  while (i + 2 < points_.size() && points_[i + 1].time_s <= time_s) ++i;
  hint = i;
  const Point& a = points_[i];
  const Point& b = points_[i + 1];
  const double width = b.time_s - a.time_s;
  const double u = (time_s - a.time_s) / width;
  const double h01 = u * u * (3.0 - 2.0 * u);
  const double h10 = u * (1.0 - u) * (1.0 - u) * width;
  const double h11 = -u * u * (1.0 - u) * width;
  Vec3 position{};
  for (int k = 0; k < 3; ++k) {
    position[k] = a.position_m[k] + h01 * (b.position_m[k] - a.position_m[k]) + h10 * slope_m_s_[i][k] + h11 * slope_m_s_[i + 1][k];
  }
  return position;
}

Propagation::Propagation(const Path& path, const Vec3& receiver_m, double sample_rate_hz, double longest_m)
    : path_(&path), receiver_m_(receiver_m), rate_hz_(sample_rate_hz) {
  if (!(longest_m >= 0.0) || !(longest_m < 1e5)) throw InputError("a source must stay within 100 km of the listener");
  const double samples = longest_m / kSoundSpeedMs * sample_rate_hz + kTaps + 4;
  history_.assign(std::bit_ceil(static_cast<std::size_t>(samples)), 0.0);
  distance_m_ = calc_distance_m(0.0);
  get_sinc_table();  // built here, not in process()
}

double Propagation::calc_distance_m(double time_s) noexcept {
  const Vec3 position = path_->find_position(time_s, hint_);
  const double x = position[0] - receiver_m_[0], y = position[1] - receiver_m_[1], z = position[2] - receiver_m_[2];
  return std::max(kNearestM, std::sqrt(x * x + y * y + z * z));
}

/// The source's pressure at a time given in samples; nothing sounds before sample 0.
double Propagation::read_history(double sample) const noexcept {
  const double whole = std::floor(sample);
  const double phase = (sample - whole) * kPhases;
  const int index = std::min(static_cast<int>(phase), kPhases - 1);
  const double mix = phase - index;
  const Taps& a = get_sinc_table()[static_cast<std::size_t>(index)];
  const Taps& b = get_sinc_table()[static_cast<std::size_t>(index) + 1];
  const std::size_t mask = history_.size() - 1;
  const std::int64_t first = static_cast<std::int64_t>(whole) - kTaps / 2 + 1;
  double sum = 0.0;
  for (int tap = 0; tap < kTaps; ++tap) {
    const std::int64_t n = first + tap;
    if (n < 0 || n >= position_ || n < position_ - static_cast<std::int64_t>(history_.size())) continue;
    sum += (a[tap] + mix * (b[tap] - a[tap])) * history_[static_cast<std::size_t>(n) & mask];
  }
  return sum;
}

void Propagation::process(std::span<const double> pressure_pa, std::span<double> received_pa) noexcept {
  const std::size_t mask = history_.size() - 1;
  const int steps = path_->is_still() ? 0 : 3;
  for (std::size_t n = 0; n < std::min(pressure_pa.size(), received_pa.size()); ++n) {
    history_[static_cast<std::size_t>(position_) & mask] = pressure_pa[n];
    const double arrival = static_cast<double>(position_ - kLatency);
    ++position_;
    for (int step = 0; step < steps; ++step) distance_m_ = calc_distance_m(arrival / rate_hz_ - distance_m_ / kSoundSpeedMs);
    const double emission = arrival - distance_m_ / kSoundSpeedMs * rate_hz_;
    if (emission > -kTaps) received_pa[n] += read_history(emission) / distance_m_;
  }
}

}  // namespace carillon::synth
