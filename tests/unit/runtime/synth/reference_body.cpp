// Method:     every mode is an oscillator q'' + 2 d q' + lambda q = phi(x) . F(t), advanced by its exact map from sample to sample: a
//             complex rotation for under-damped modes, the real 2 x 2 map at, near and above critical damping. During a pulse each sample
//             adds the exact response to the part of the force within it (pulse.hpp), so timing is not quantised and nothing sounds before
//             the pulse. Pressure p = sum g_m q'_m.
// Source:     OSG02 section 4 (one complex multiply per mode and sample), corrected by its missing factor 1/2 in eq. 16-18;
//             docs/equations.md.
// Deviations: the audible band is tested with sqrt(lambda), not the damped frequency, which would drop over-damped modes.
#include "tests/unit/runtime/synth/reference_body.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <numeric>

#include "runtime/base/error.hpp"
#include "runtime/base/sort_order.hpp"
#include "runtime/synth/oscillator.hpp"

namespace carillon::testing {

using synth::calc_chebyshev_coefficients;
using synth::calc_oscillator_map;
using synth::get_chebyshev_points;
using synth::OscillatorMap;

namespace {

// Relative distance from critical damping below which q' = re - (d / omega_d) im loses digits.
constexpr double kNearCritical = 0.05;
// Largest |root| x step that kMoments Chebyshev terms resolve.
constexpr double kStiffest = 4.0;
// A mode that decays within 1/1024 of a sample is not rendered.
constexpr int kMaxSubsteps = 256;
// States below this are zeroed, long before they become denormal.
constexpr double kNothing = 1e-60;

bool is_finite(const Vec3& v) { return std::isfinite(v[0]) && std::isfinite(v[1]) && std::isfinite(v[2]); }

void check_bank(const bank::Bank& bank) {
  const std::size_t m = bank.mode_count();
  if (bank.decay_per_s.size() != m || bank.radiation_gain.size() != m || bank.shape_scale.size() != m ||
      bank.shape.size() != bank.vertex_count() * m * 3) {
    throw InputError("mode bank: its arrays disagree in length; make the bank again with carillon-precompute");
  }
  for (const auto& triangle : bank.triangles) {
    for (const std::int32_t vertex : triangle) {
      if (vertex < 0 || static_cast<std::size_t>(vertex) >= bank.vertex_count()) {
        throw InputError("mode bank: a triangle names a vertex that does not exist; make the bank again with carillon-precompute");
      }
    }
  }
}

}  // namespace

ReferenceBody::ReferenceBody(const bank::Bank& bank, double sample_rate_hz, ReferenceBodyOptions options)
    : bank_(&bank), rate_hz_(sample_rate_hz), silence_pa_(options.silence_pa) {
  if (!(sample_rate_hz > 0.0) || !std::isfinite(sample_rate_hz)) throw InputError("the sample rate must be a positive number of Hz");
  check_bank(bank);
  // Slow modes first: tiles of modes that decay alike fall asleep together.
  const std::vector<std::size_t> order = base::find_sort_order(bank.decay_per_s);
  const double nyquist_rad_s = std::numbers::pi * sample_rate_hz;
  for (const std::size_t mode : order) {
    const double omega = std::sqrt(bank.eigenvalue_rad2_s2[mode]);
    if (!(omega < nyquist_rad_s)) continue;
    if (bank.decay_per_s[mode] < omega * std::sqrt(1.0 - kNearCritical * kNearCritical)) {
      add_tile_mode(mode);
    } else {
      add_damped_mode(mode);
    }
  }
  mode_count_ = tile_modes_ + static_cast<int>(damped_.size());
  std::stable_sort(damped_.begin(), damped_.end(), [](const DampedMode& a, const DampedMode& b) { return a.substeps < b.substeps; });
  const std::size_t room = std::max(1, options.max_strikes);
  pulses_.reserve(room);
  acting_.reserve(room);
  moments_.resize(room);
}

void ReferenceBody::add_tile_mode(std::size_t mode) {
  const int lane = tile_modes_ % kLanes;
  if (lane == 0) {
    tiles_.emplace_back();
    tiles_.back().mode.fill(-1);
  }
  Tile& tile = tiles_.back();
  const double d = bank_->decay_per_s[mode];
  const double omega = std::sqrt(bank_->eigenvalue_rad2_s2[mode]);
  const double omega_d = std::sqrt((omega - d) * (omega + d));
  const auto answer = [&](double time_s) { return std::exp(-d * time_s) * std::polar(1.0, omega_d * time_s); };
  const double h = 1.0 / rate_hz_;
  const std::complex<double> turn = answer(h);
  tile.turn_re[lane] = turn.real();
  tile.turn_im[lane] = turn.imag();
  tile.out_re[lane] = bank_->radiation_gain[mode];
  tile.out_im[lane] = -bank_->radiation_gain[mode] * d / omega_d;
  tile.mode[lane] = static_cast<std::int32_t>(mode);
  const auto points = get_chebyshev_points();
  std::array<double, kMoments> re{}, im{};
  for (int k = 0; k < kMoments; ++k) {
    const std::complex<double> value = answer((1.0 - points[k]) * h);
    re[k] = value.real();
    im[k] = value.imag();
  }
  const Moments cre = calc_chebyshev_coefficients(re);
  const Moments cim = calc_chebyshev_coefficients(im);
  for (int j = 0; j < kMoments; ++j) {
    tile.force_re[j][lane] = cre[j];
    tile.force_im[j][lane] = cim[j];
  }
  ++tile_modes_;
}

void ReferenceBody::add_damped_mode(std::size_t mode) {
  const double d = bank_->decay_per_s[mode];
  const double lambda = bank_->eigenvalue_rad2_s2[mode];
  const double h = 1.0 / rate_hz_;
  const double omega = std::sqrt(lambda);
  const double fastest = d > omega ? d + std::sqrt((d - omega) * (d + omega)) : omega;
  int substeps = 1;
  while (fastest * h / substeps > kStiffest && substeps < kMaxSubsteps) substeps *= 2;
  if (fastest * h / substeps > kStiffest) return;
  DampedMode m{};
  const OscillatorMap full = calc_oscillator_map(lambda, d, h);
  const OscillatorMap sub = calc_oscillator_map(lambda, d, h / substeps);
  m.qq = full.qq, m.qv = full.qv, m.vq = full.vq, m.vv = full.vv;
  m.sub_qq = sub.qq, m.sub_qv = sub.qv, m.sub_vq = sub.vq, m.sub_vv = sub.vv;
  const auto points = get_chebyshev_points();
  std::array<double, kMoments> q{}, v{};
  for (int k = 0; k < kMoments; ++k) {
    const OscillatorMap part = calc_oscillator_map(lambda, d, (1.0 - points[k]) * h / substeps);
    q[k] = part.qv;
    v[k] = part.vv;
  }
  m.force_q = calc_chebyshev_coefficients(q);
  m.force_v = calc_chebyshev_coefficients(v);
  m.gain = bank_->radiation_gain[mode];
  m.mode = static_cast<std::int32_t>(mode);
  m.substeps = substeps;
  damped_.push_back(m);
}

bool ReferenceBody::strike(const Strike& strike) noexcept {
  const bool sane = std::isfinite(strike.sample) && std::isfinite(strike.duration_s) && strike.duration_s >= 0.0 &&
                    is_finite(strike.barycentric) && is_finite(strike.impulse_n_s) && strike.triangle >= 0 &&
                    strike.triangle < std::ssize(bank_->triangles);
  if (!sane || pulses_.size() == pulses_.capacity()) {
    ++counters_.refused;
    return false;
  }
  Pulse pulse;
  pulse.duration = strike.duration_s * rate_hz_;
  pulse.begin = strike.sample - 0.5 * pulse.duration;
  // The sample at position_ is the next one: forces after position_ - 1 are still audible.
  const double earliest = static_cast<double>(position_ - 1);
  if (!(pulse.begin > earliest)) {
    pulse.begin = std::nextafter(earliest, earliest + 1.0);
    ++counters_.late;
  }
  pulse.vertex = bank_->triangles[strike.triangle];
  pulse.barycentric = strike.barycentric;
  pulse.impulse_n_s = strike.impulse_n_s;
  pulses_.push_back(pulse);
  ++counters_.accepted;
  return true;
}

void ReferenceBody::process(std::span<double> pressure_pa) noexcept {
  while (!pressure_pa.empty()) {
    // Chunks end at multiples of kChunk since the beginning, whatever the sizes of the calls.
    const std::size_t room = kChunk - position_ % kChunk;
    const std::size_t samples = std::min(room, pressure_pa.size());
    process_chunk(pressure_pa.first(samples));
    pressure_pa = pressure_pa.subspan(samples);
  }
}

void ReferenceBody::process_chunk(std::span<double> pressure_pa) noexcept {
  const int samples = static_cast<int>(pressure_pa.size());
  const int acting = pulses_.empty() ? 0 : find_acting_pulses(samples);
  if (awake_ || acting > 0) {
    awake_ = true;
    std::array<double, kChunk> pressure{};
    for (int n = 0; n < samples; ++n) sum_[n].fill(0.0);
    for (Tile& tile : tiles_) {
      if (acting > 0) calc_forcing(tile, acting, samples);
      if (acting > 0 || tile.live) advance_tile(tile, samples, acting > 0);
    }
    if (acting > 0 || damped_live_) advance_damped_modes(std::span(pressure).first(pressure_pa.size()), acting > 0);
    double check = 0.0;
    for (int n = 0; n < samples; ++n) {
      for (const double lane : sum_[n]) pressure[n] += lane;
      check += pressure[n];
    }
    if (std::isfinite(check)) {
      for (int n = 0; n < samples; ++n) pressure_pa[n] += pressure[n];
    } else {
      reset();
    }
  }
  position_ += samples;
  if (acting > 0) retire_pulses();
  if (awake_ && acting == 0 && position_ % kChunk == 0) fall_asleep_if_silent();
}

/// Lists the pulses in this chunk, with their moments for each sample.
int ReferenceBody::find_acting_pulses(int samples) noexcept {
  acting_.clear();
  for (std::size_t i = 0; i < pulses_.size(); ++i) {
    const Pulse& pulse = pulses_[i];
    // The interval of sample n is (n - 1, n].
    const double begin = pulse.begin - static_cast<double>(position_ - 1);
    if (begin > samples) continue;
    for (int n = 0; n < samples; ++n)
      moments_[acting_.size()][n] = synth::calc_pulse_moments(synth::PulseShape::kHertz, begin - n, pulse.duration);
    acting_.push_back(static_cast<int>(i));
  }
  return static_cast<int>(acting_.size());
}

/// phi(x) . J of one mode, phi interpolated in the triangle.
double ReferenceBody::calc_projection(const Pulse& pulse, std::int32_t mode) const noexcept {
  double sum = 0.0;
  for (int corner = 0; corner < 3; ++corner) {
    const std::size_t row = static_cast<std::size_t>(pulse.vertex[corner]) * bank_->mode_count() + static_cast<std::size_t>(mode);
    const std::int16_t* s = &bank_->shape[row * 3];
    sum += pulse.barycentric[corner] * (s[0] * pulse.impulse_n_s[0] + s[1] * pulse.impulse_n_s[1] + s[2] * pulse.impulse_n_s[2]);
  }
  return sum * bank_->shape_scale[mode];
}

void ReferenceBody::calc_forcing(const Tile& tile, int acting, int samples) noexcept {
  for (int n = 0; n < samples; ++n) {
    forcing_re_[n].fill(0.0);
    forcing_im_[n].fill(0.0);
  }
  for (int i = 0; i < acting; ++i) {
    Lanes amplitude{};
    for (int l = 0; l < kLanes; ++l) {
      if (tile.mode[l] >= 0) amplitude[l] = calc_projection(pulses_[acting_[i]], tile.mode[l]);
    }
    for (int n = 0; n < samples; ++n) {
      const Moments& moments = moments_[i][n];
      if (moments[0] == 0.0) continue;
      Lanes re{}, im{};
      for (int j = 0; j < kMoments; ++j) {
        for (int l = 0; l < kLanes; ++l) {
          re[l] += moments[j] * tile.force_re[j][l];
          im[l] += moments[j] * tile.force_im[j][l];
        }
      }
      for (int l = 0; l < kLanes; ++l) {
        forcing_re_[n][l] += amplitude[l] * re[l];
        forcing_im_[n][l] += amplitude[l] * im[l];
      }
    }
  }
}

void ReferenceBody::advance_tile(Tile& tile, int samples, bool driven) noexcept {
  Lanes re = tile.re, im = tile.im;
  const Lanes turn_re = tile.turn_re, turn_im = tile.turn_im, out_re = tile.out_re, out_im = tile.out_im;
  for (int n = 0; n < samples; ++n) {
    Lanes& sum = sum_[n];
    for (int l = 0; l < kLanes; ++l) {
      const double turned_re = re[l] * turn_re[l] - im[l] * turn_im[l];
      const double turned_im = re[l] * turn_im[l] + im[l] * turn_re[l];
      re[l] = turned_re;
      im[l] = turned_im;
    }
    if (driven) {
      for (int l = 0; l < kLanes; ++l) {
        re[l] += forcing_re_[n][l];
        im[l] += forcing_im_[n][l];
      }
    }
    for (int l = 0; l < kLanes; ++l) sum[l] += out_re[l] * re[l] + out_im[l] * im[l];
  }
  tile.re = re;
  tile.im = im;
  tile.live = true;
}

void ReferenceBody::advance_damped_modes(std::span<double> pressure, bool driven) noexcept {
  damped_live_ = !damped_.empty();
  for (std::size_t first = 0; first < damped_.size();) {
    const int substeps = driven ? damped_[first].substeps : 1;
    std::size_t last = first + 1;
    while (last < damped_.size() && (!driven || damped_[last].substeps == substeps)) ++last;
    const std::span<DampedMode> group(damped_.data() + first, last - first);
    for (std::size_t n = 0; n < pressure.size(); ++n) {
      for (int step = 0; driven && step < substeps; ++step) {
        for (DampedMode& m : group) {
          const double q = m.sub_qq * m.q + m.sub_qv * m.v;
          m.v = m.sub_vq * m.q + m.sub_vv * m.v;
          m.q = q;
        }
        for (const int index : acting_) {
          const Pulse& pulse = pulses_[index];
          const double begin = pulse.begin - static_cast<double>(position_ - 1) - static_cast<double>(n);
          const Moments moments = synth::calc_pulse_moments(synth::PulseShape::kHertz, begin * substeps - step, pulse.duration * substeps);
          if (moments[0] == 0.0) continue;
          for (DampedMode& m : group) {
            const double amplitude = calc_projection(pulse, m.mode);
            for (int j = 0; j < kMoments; ++j) {
              m.q += amplitude * moments[j] * m.force_q[j];
              m.v += amplitude * moments[j] * m.force_v[j];
            }
          }
        }
      }
      for (DampedMode& m : group) {
        if (!driven) {
          const double q = m.qq * m.q + m.qv * m.v;
          m.v = m.vq * m.q + m.vv * m.v;
          m.q = q;
        }
        pressure[n] += m.gain * m.v;
      }
    }
    first = last;
  }
}

/// Removes the pulses that ended before the next samples.
void ReferenceBody::retire_pulses() noexcept {
  const double heard = static_cast<double>(position_ - 1);
  std::erase_if(pulses_, [heard](const Pulse& pulse) { return pulse.begin + pulse.duration <= heard; });
}

void ReferenceBody::fall_asleep_if_silent() noexcept {
  const double share = silence_pa_ / static_cast<double>(tiles_.size() + 1);
  bool awake = false;
  for (Tile& tile : tiles_) {
    if (!tile.live) continue;
    double bound = 0.0;
    for (int l = 0; l < kLanes; ++l) {
      const double size = std::abs(tile.re[l]) + std::abs(tile.im[l]);
      if (size < kNothing) tile.re[l] = tile.im[l] = 0.0;
      bound += size * (std::abs(tile.out_re[l]) + std::abs(tile.out_im[l]));
    }
    tile.live = bound >= share;
    if (!tile.live) tile.re = tile.im = Lanes{};
    awake = awake || tile.live;
  }
  double bound = 0.0;
  for (DampedMode& m : damped_) {
    // q' of an unforced mode never exceeds |q'| + 2 omega |q| from here on.
    const double size = std::abs(m.v) + 2.0 * std::sqrt(bank_->eigenvalue_rad2_s2[m.mode]) * std::abs(m.q);
    if (size < kNothing) m.q = m.v = 0.0;
    bound += size * std::abs(m.gain);
  }
  damped_live_ = bound >= share;
  if (!damped_live_) {
    for (DampedMode& m : damped_) m.q = m.v = 0.0;
  }
  awake_ = awake || damped_live_;
}

void ReferenceBody::reset() noexcept {
  for (Tile& tile : tiles_) {
    tile.re = tile.im = Lanes{};
    tile.live = false;
  }
  for (DampedMode& m : damped_) m.q = m.v = 0.0;
  damped_live_ = false;
  awake_ = false;
  pulses_.clear();
  acting_.clear();
  ++counters_.resets;
}

int ReferenceBody::get_live_mode_count() const {
  int live = damped_live_ ? static_cast<int>(damped_.size()) : 0;
  for (const Tile& tile : tiles_) {
    if (!tile.live) continue;
    live += static_cast<int>(std::count_if(tile.mode.begin(), tile.mode.end(), [](std::int32_t mode) { return mode >= 0; }));
  }
  return live;
}

double ReferenceBody::calc_energy_j() const noexcept {
  double energy = 0.0;
  const auto add = [&](std::size_t mode, double q, double v) { energy += 0.5 * (v * v + bank_->eigenvalue_rad2_s2[mode] * q * q); };
  for (const Tile& tile : tiles_) {
    for (int l = 0; l < kLanes; ++l) {
      if (tile.mode[l] < 0) continue;
      const std::size_t mode = tile.mode[l];
      const double d = bank_->decay_per_s[mode];
      const double omega = std::sqrt(bank_->eigenvalue_rad2_s2[mode]);
      const double q = tile.im[l] / std::sqrt((omega - d) * (omega + d));
      add(mode, q, tile.re[l] - d * q);
    }
  }
  for (const DampedMode& m : damped_) add(static_cast<std::size_t>(m.mode), m.q, m.v);
  return energy;
}

}  // namespace carillon::testing
