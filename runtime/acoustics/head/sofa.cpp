// Method:     the onset of a response is where it first exceeds 0.15 of its peak, on a grid of 1/16 sample. One windowed sinc both
//             resamples it and moves its onset to sample kOnset; the sinc is limited to the lower Nyquist frequency.
// Source:     AES69-2015 (SOFA); Andreopoulou and Katz 2017 (onsets by a threshold, among others).
#include "runtime/acoustics/head/sofa.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <numbers>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "runtime/acoustics/head/convolve.hpp"
#include "runtime/acoustics/head/parse_sofa.hpp"
#include "runtime/acoustics/head/sphere.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/file.hpp"
#include "runtime/base/printable.hpp"
#include "runtime/base/sinc.hpp"

namespace carillon::head {

#ifdef CARILLON_HAS_SOFA

namespace {

constexpr std::uint64_t kMaxBytes = std::uint64_t{1} << 29U;
constexpr double kThreshold = 0.15;  // onset threshold, share of the peak
constexpr int kRaster = 16;          // grid points per sample
constexpr double kTail = 1e-6;       // share of the energy of a response
constexpr double kLevelFromHz = 400.0, kLevelToHz = 800.0;
constexpr double kPoleRad = 0.2618;  // 15 degrees
constexpr double kRingRad = 0.0175;  // thickness of a ring, 1 degree

/// Measured responses with checked sizes.
struct Measured {
  double sample_rate_hz = 0.0;
  std::size_t taps = 0;
  std::vector<Vec3> directions{};            // unit
  std::vector<std::span<const float>> of{};  // responses in the memory of the SofaFile: left and right per direction
  std::vector<double> delays{};              // [samples], in addition to the delay within the responses
};

[[noreturn]] void refuse(const std::string& name, std::string_view why) { throw InputError(fmt::format("{}: {}", name, why)); }

/// Sources in the frame of the head [m].
std::vector<Vec3> find_sources(const SofaFile& sofa, const std::string& name) {
  constexpr double kRad = std::numbers::pi / 180.0;
  std::vector<Vec3> sources(sofa.measurements);
  for (std::size_t m = 0; m < sources.size(); ++m) {
    const float* const row = sofa.sources.data() + 3 * m;
    const double a = static_cast<double>(row[0]), b = static_cast<double>(row[1]), c = static_cast<double>(row[2]);
    sources[m] = sofa.is_cartesian
                     ? Vec3{a, b, c}
                     : c * Vec3{std::cos(b * kRad) * std::cos(a * kRad), std::cos(b * kRad) * std::sin(a * kRad), std::sin(b * kRad)};
    if (!(norm(sources[m]) > 0.0)) refuse(name, fmt::format("source {} is in the middle of the head", m));
  }
  return sources;
}

/// Measurements at the farthest distance, one per direction.
Measured select_measured(const SofaFile& sofa, const std::string& name) {
  const std::vector<Vec3> sources = find_sources(sofa, name);
  double farthest = 0.0;
  for (const Vec3& source : sources) farthest = std::max(farthest, norm(source));
  Measured measured{.sample_rate_hz = sofa.sample_rate_hz, .taps = sofa.taps};
  if (!(measured.sample_rate_hz >= kMinRateHz && measured.sample_rate_hz <= kMaxRateHz))
    refuse(name, fmt::format("its sample rate, {} Hz, is outside {} to {} Hz", measured.sample_rate_hz, kMinRateHz, kMaxRateHz));
  // Sorted by height, so that equal directions, such as those of a pole, are neighbours.
  std::vector<std::pair<double, std::size_t>> order;
  for (std::size_t m = 0; m < sources.size(); ++m)
    if (norm(sources[m]) > 0.99 * farthest) order.emplace_back(normalise(sources[m])[2], m);
  std::sort(order.begin(), order.end());
  const std::span<const float> responses = sofa.responses, delays = sofa.delays;
  for (const auto& [height, m] : order) {
    const Vec3 direction = normalise(sources[m]);
    bool is_new = true;
    for (std::size_t i = measured.directions.size(); i-- > 0 && height - measured.directions[i][2] < Directions::kNearestRad && is_new;)
      is_new = norm(direction - measured.directions[i]) >= Directions::kNearestRad;
    if (!is_new) continue;
    measured.directions.push_back(direction);
    for (std::size_t ear = 0; ear < 2; ++ear) {
      measured.of.push_back(responses.subspan((2 * m + ear) * measured.taps, measured.taps));
      measured.delays.push_back(delays.empty() ? 0.0 : static_cast<double>(delays[delays.size() == 2 ? ear : 2 * m + ear]));
    }
  }
  return measured;
}

/// Onset of a response [samples]. 0 for silence.
double find_onset(std::span<const float> response) {
  float peak = 0.0F;
  for (const float value : response) peak = std::max(peak, std::abs(value));
  if (peak == 0.0F) return 0.0;
  const base::Sinc& sinc = base::Sinc::get();
  const auto read = [&](double place) {
    const auto first = static_cast<std::ptrdiff_t>(std::floor(place)) - base::kSincHalf + 1;
    double sum = 0.0;
    for (std::ptrdiff_t k = std::max<std::ptrdiff_t>(first, 0); k < first + base::kSincTaps && k < std::ssize(response); ++k)
      sum += static_cast<double>(response[k]) * sinc.evaluate(place - static_cast<double>(k));
    return std::abs(sum);
  };
  const double wanted = kThreshold * static_cast<double>(peak);
  std::size_t first = 0;  // first sample beyond the threshold
  while (static_cast<double>(std::abs(response[first])) < wanted) ++first;
  double place = std::max(static_cast<double>(first) - 1.0, -1.0), before = read(place);
  for (int step = 0; step < kRaster; ++step) {
    const double next = place + 1.0 / kRaster, value = read(next);
    if (value >= wanted) return before < wanted ? place + (wanted - before) / (value - before) / kRaster : place;
    place = next;
    before = value;
  }
  return place;
}

/// Sample n of `to` is the response at (n - kOnset) / ratio + onset, over ratio.
void resample(std::span<const float> response, double onset, double ratio, std::span<float> to) {
  const base::Sinc& sinc = base::Sinc::get();
  const double band = std::min(1.0, ratio), reach = base::kSincHalf / band;
  for (std::size_t n = 0; n < to.size(); ++n) {
    const double place = (static_cast<double>(n) - kOnset) / ratio + onset;
    const auto first = static_cast<std::ptrdiff_t>(std::ceil(place - reach)), last = static_cast<std::ptrdiff_t>(std::floor(place + reach));
    double sum = 0.0;
    for (std::ptrdiff_t k = std::max<std::ptrdiff_t>(first, 0); k <= std::min(last, std::ssize(response) - 1); ++k)
      sum += static_cast<double>(response[k]) * sinc.evaluate(band * (place - static_cast<double>(k)));
    to[n] = static_cast<float>(sum * band / ratio);
  }
}

/// All responses (directions, 2, taps) and delays [samples], aligned, at the playback rate.
Head::Content align(const Measured& measured, double sample_rate_hz, const std::string& name) {
  const double ratio = sample_rate_hz / measured.sample_rate_hz;
  const auto taps =
      static_cast<std::size_t>(kTapUnit * std::ceil((std::ceil(static_cast<double>(measured.taps) * ratio) + kOnset) / kTapUnit));
  if (taps > kMaxTaps)
    refuse(name, fmt::format("its responses have {} taps at {} Hz; at most {} are supported", taps, sample_rate_hz, kMaxTaps));
  const std::size_t count = measured.of.size();
  if (count * taps > kMaxSamples)
    refuse(name, fmt::format("it has {} samples at {} Hz, at most {} are supported; shorten its responses", count * taps, sample_rate_hz,
                             kMaxSamples));
  Head::Content head{.sample_rate_hz = sample_rate_hz, .taps = static_cast<int>(taps), .responses = {}, .delays = {}, .lookup = ByAngle{}};
  head.responses.resize(count * taps);
  for (std::size_t i = 0; i < count; ++i) {
    const double onset = find_onset(measured.of[i]);
    head.delays.push_back((onset + measured.delays[i]) * ratio);
    resample(measured.of[i], onset, ratio, std::span(head.responses).subspan(i * taps, taps));
  }
  return head;
}

/// Adds a missing pole with the mean of the nearest ring.
void add_poles(std::vector<Vec3>& directions, Head::Content& head) {
  const std::size_t taps = head.taps;
  for (const double up : {-1.0, 1.0}) {
    double nearest = std::numbers::pi;
    const auto calc_angle = [&](const Vec3& d) { return std::acos(std::clamp(up * d[2], -1.0, 1.0)); };
    const std::size_t measured = directions.size();
    for (const Vec3& d : directions) nearest = std::min(nearest, calc_angle(d));
    if (nearest < kPoleRad) continue;
    std::vector<double> sum(2 * taps);
    std::array<double, 2> delay{};
    double ring = 0.0;
    for (std::size_t i = 0; i < measured; ++i) {
      if (calc_angle(directions[i]) > nearest + kRingRad) continue;
      for (std::size_t n = 0; n < 2 * taps; ++n) sum[n] += static_cast<double>(head.responses[2 * i * taps + n]);
      for (std::size_t ear = 0; ear < 2; ++ear) delay[ear] += head.delays[2 * i + ear];
      ring += 1.0;
    }
    directions.push_back({0.0, 0.0, up});
    for (const double value : sum) head.responses.push_back(static_cast<float>(value / ring));
    for (const double value : delay) head.delays.push_back(value / ring);
  }
}

/// Truncates the silent tail of all responses.
void trim(Head::Content& head) {
  const auto taps = static_cast<std::size_t>(head.taps), count = head.delays.size();
  std::size_t needed = kTapUnit;
  for (std::size_t i = 0; i < count; ++i) {
    const std::span<const float> response = std::span<const float>(head.responses).subspan(i * taps, taps);
    double energy = 0.0, tail = 0.0;
    for (const float value : response) energy += static_cast<double>(value) * static_cast<double>(value);
    std::size_t end = taps;
    for (; end > needed; --end) {
      tail += static_cast<double>(response[end - 1]) * static_cast<double>(response[end - 1]);
      if (tail > kTail * energy) break;
    }
    needed = std::max(needed, end);
  }
  needed = std::min(taps, (needed + kTapUnit - 1) / kTapUnit * kTapUnit);
  for (std::size_t i = 0; i < count; ++i)
    std::copy_n(head.responses.begin() + static_cast<std::ptrdiff_t>(i * taps), needed,
                head.responses.begin() + static_cast<std::ptrdiff_t>(i * needed));
  head.responses.resize(count * needed);
  head.taps = static_cast<int>(needed);
}

/// Scales the mean power from kLevelFromHz to kLevelToHz to that of a sphere.
void set_level(Head::Content& head, const std::string& name) {
  constexpr int kFrequencies = 9;
  const Sphere sphere;
  double power = 0.0, wanted = 0.0;
  for (int f = 0; f < kFrequencies; ++f) {
    const double omega = 2.0 * std::numbers::pi * (kLevelFromHz + (kLevelToHz - kLevelFromHz) * f / (kFrequencies - 1));
    wanted += calc_sphere_mean_power(omega * sphere.radius_m / sphere.sound_speed_m_s) / kFrequencies;
    std::vector<std::complex<double>> wave(head.taps);
    for (std::size_t n = 0; n < wave.size(); ++n) wave[n] = std::polar(1.0, -omega * static_cast<double>(n) / head.sample_rate_hz);
    for (std::size_t i = 0; i < head.delays.size(); ++i) {
      std::complex<double> sum = 0.0;
      for (std::size_t n = 0; n < wave.size(); ++n) sum += static_cast<double>(head.responses[i * wave.size() + n]) * wave[n];
      power += std::norm(sum) / kFrequencies / static_cast<double>(head.delays.size());
    }
  }
  const double gain = std::sqrt(wanted / power);
  if (!std::isfinite(gain) || !(gain > 0.0)) refuse(name, "its responses are silent");
  for (float& value : head.responses) value = static_cast<float>(gain * static_cast<double>(value));
}

/// Sets the delay of the origin to the mean delay; delays stay non-negative.
void set_origin(Head::Content& head, const std::string& name) {
  double mean = 0.0;
  for (const double delay : head.delays) mean += delay / static_cast<double>(head.delays.size());
  const auto [least, most] = std::minmax_element(head.delays.begin(), head.delays.end());
  const double spread_s = (*most - *least) / head.sample_rate_hz;
  if (!(spread_s <= kMaxSpreadS))
    refuse(name, fmt::format("its delays differ by {:.1f} ms; a head causes about 1 ms, at most {:.0f} ms are allowed", 1e3 * spread_s,
                             1e3 * kMaxSpreadS));
  head.origin_samples = static_cast<int>(std::ceil(mean - *least));
  for (double& delay : head.delays) delay = std::max(0.0, delay - mean + head.origin_samples);
}

}  // namespace

bool has_sofa() noexcept { return true; }

std::shared_ptr<const Head> read_sofa(const std::filesystem::path& file, double sample_rate_hz) {
  const std::string name = base::printable(file.string());
  if (!(sample_rate_hz >= kMinRateHz && sample_rate_hz <= kMaxRateHz))
    refuse(name, fmt::format("a sample rate of {} Hz is outside {} to {} Hz", sample_rate_hz, kMinRateHz, kMaxRateHz));
  const SofaFile sofa = parse_sofa(base::read_file(file, "SOFA file", kMaxBytes), name);
  const Measured measured = select_measured(sofa, name);
  std::vector<Vec3> directions = measured.directions;
  Head::Content head = align(measured, sample_rate_hz, name);
  trim(head);
  set_level(head, name);
  add_poles(directions, head);
  set_origin(head, name);
  head.lookup = ByDirection{Directions(directions, name)};
  return std::make_shared<const Head>(std::move(head));
}

#else

bool has_sofa() noexcept { return false; }

std::shared_ptr<const Head> read_sofa(const std::filesystem::path& file, double) {
  throw InputError(base::printable(file.string()) + ": this build is without SOFA; build it with CARILLON_SOFA=ON, or use the sphere");
}

#endif

}  // namespace carillon::head
