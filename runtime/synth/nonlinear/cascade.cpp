// Method:     wave turbulence in a plate passes energy to higher frequencies at the power eps = kappa f e^2 (-de/df) / (m^2 h^4 df^3), e
//             the energy of a mode, df the spacing of modes; integrated between two bands, kappa (e1^3 - e2^3) / (3 ln(f2 / f1)) over the
//             same. Its steady state is e^3 ~ ln(f* / f), the spectrum of Kolmogorov and Zakharov. Modes above the coupled ones are grouped
//             into bands; the lowest band takes energy from the upper third of the coupled modes, as a viscosity on their velocity; the
//             highest passes none on. The gain of a band is applied as kicks of random sign and size to its modes, and the band is then
//             scaled to its energy balance. The mean tension rotates all modes by the same additional angle: lambda + tau omega is omega +
//             tau / 2, to first order.
// Source:     Duering, Josserand and Rica, Phys. Rev. Lett. 97 (2006) 025503 (spectrum); Humbert, Josserand, Touze and Cadot, Physica D 316
//             (2016) 34 (diffusion); Cirio, Qu, Drettakis, Grinspun and Zheng, ACM Trans. Graph. 37 (2018) 100 (diffusion in sound);
//             docs/equations.md E12.
// Deviations: kappa is fitted to full-order runs (tests/bench/nonlinear/cascade). Tension is a scalar, since the stress of the coupled
//             modes is known in their own shapes only, and does no work on these modes. No energy flows back to the coupled modes.
#include "runtime/synth/nonlinear/cascade.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "runtime/base/chance.hpp"
#include "runtime/base/error.hpp"

namespace carillon::nonlinear {
namespace {

constexpr double kBandRatio = 1.1225;     // 2^(1/6), ratio of neighbouring band frequencies
constexpr std::size_t kSmallestBand = 4;  // modes

constexpr double kTopShare = 1.0 / 3.0;      // of the coupled modes: sources
constexpr double kCutoffRatio = 1.12;        // frequency ratio beyond the last band at which the energy vanishes
constexpr double kMostShare = 0.1;           // of the energy of a band, per exchange
constexpr double kEqualising = 0.2;          // of the exchange that would equalise two bands
constexpr double kMinTransferShare = 1e-10;  // of the energy of a band: smaller transfers are skipped
constexpr double kSmallestAngle = 1e-10;     // rad
constexpr double kLargestAngle = 0.4;        // rad a sample, 3 kHz at 48 kHz
constexpr double kSmallestJ = 1e-200;

double to_hz(double eigenvalue) { return std::sqrt(eigenvalue) / (2.0 * std::numbers::pi); }

}  // namespace

Cascade::Cascade(std::span<const ModeConstants> coupled, std::span<const ModeConstants> above, const CascadeBody& body, double rate_hz,
                 const CascadeOptions& options)
    : options_(options), period_s_(1.0 / rate_hz), count_(static_cast<int>(above.size())), chance_(options.seed) {
  const auto is_positive = [](double x) { return x > 0.0 && std::isfinite(x); };
  if (!is_positive(rate_hz)) throw InputError("cascade: the sample rate must be a positive number of Hz");
  if (!is_positive(body.mass_kg) || !is_positive(body.thickness_m) || !is_positive(options.constant))
    throw InputError("cascade: the mass, the thickness and the constant must be positive numbers");
  if (coupled.empty() || above.empty()) throw InputError("cascade: no coupled modes, or no modes above them");
  for (auto* values : {&vv_, &vy_, &yv_, &yy_, &tilt_, &damped_share_, &omega_, &v_, &y_, &noise_}) values->assign(above.size(), 0.0);
  double largest = 0.0;
  for (std::size_t m = 0; m < above.size(); ++m) {
    const double lambda = above[m].eigenvalue_rad2_s2, d = above[m].decay_per_s, omega = std::sqrt(lambda);
    const double damped = std::sqrt((omega - d) * (omega + d)), angle = damped * period_s_, keep = std::exp(-d * period_s_);
    if (!(d >= 0.0) || !(damped > 0.0) || !std::isfinite(damped) || !(omega * period_s_ < std::numbers::pi))
      throw InputError(fmt::format("cascade: mode {} has {:.6g} Hz and a decay of {:.6g} 1/s; it must oscillate, below {:.6g} Hz", m,
                                   omega / (2.0 * std::numbers::pi), d, 0.5 * rate_hz));
    const double c = std::cos(angle), s = std::sin(angle), tilt = d / damped, share = damped / omega;
    vv_[m] = keep * (c - tilt * s);
    vy_[m] = -keep * s / share;
    yv_[m] = keep * s / share;
    yy_[m] = keep * (c + tilt * s);
    tilt_[m] = tilt;
    damped_share_[m] = share;
    omega_[m] = omega;
    largest = std::max(largest, omega * period_s_);
  }
  largest_angle_ = std::clamp(0.98 * std::numbers::pi - largest, 0.0, kLargestAngle);
  share_.assign(coupled.size(), 0.0);
  for (const ModeConstants& mode : coupled) coupled_hz_.push_back(to_hz(mode.eigenvalue_rad2_s2));
  for (std::size_t m = 0; m < above.size();) {
    Band band{.first = m, .last = m};
    const double begin = to_hz(above[m].eigenvalue_rad2_s2);
    double logs = 0.0;
    while (band.last < above.size() &&
           (band.last - band.first < kSmallestBand || to_hz(above[band.last].eigenvalue_rad2_s2) < kBandRatio * begin))
      logs += std::log(to_hz(above[band.last++].eigenvalue_rad2_s2));
    band.freq_hz = std::exp(logs / static_cast<double>(band.last - band.first));
    bands_.push_back(band);
    m = band.last;
  }
  const double spacing_hz =
      (to_hz(above.back().eigenvalue_rad2_s2) - coupled_hz_.front()) / static_cast<double>(coupled.size() + above.size() - 1);
  const double h2 = body.thickness_m * body.thickness_m;
  flux_per_j3_ = options.constant / (3.0 * body.mass_kg * body.mass_kg * h2 * h2 * spacing_hz * spacing_hz * spacing_hz);
  strong_j_ = options.strong * body.mass_kg * h2 * spacing_hz * spacing_hz;
  if (!is_positive(flux_per_j3_) || !is_positive(strong_j_)) throw InputError("cascade: the modes must be ascending");
}

/// Advances all modes by one sample and an additional angle.
void Cascade::turn(double angle) noexcept {
  const std::size_t count = count_;
  const double t = std::tan(0.5 * angle), c = (1.0 - t * t) / (1.0 + t * t), s = 2.0 * t / (1.0 + t * t);
  double* v = v_.data();
  double* y = y_.data();
  const double *vv = vv_.data(), *vy = vy_.data(), *yv = yv_.data(), *yy = yy_.data();
  for (std::size_t m = 0; m < count; ++m) {
    const double a = vv[m] * v[m] + vy[m] * y[m], b = yv[m] * v[m] + yy[m] * y[m];
    v[m] = c * a - s * b;
    y[m] = s * a + c * b;
  }
}

void Cascade::step(CoupledModes& coupled, std::span<const double> push_re, std::span<const double> push_im,
                   std::span<const double> keep) noexcept {
  if (is_moving_) {
    const double angle = 0.5 * period_s_ * coupled.calc_tension_rad_s();
    turn(std::abs(angle) > kSmallestAngle ? std::clamp(angle, -largest_angle_, largest_angle_) : 0.0);
    for (std::size_t m = 0; m < keep.size(); ++m) {
      v_[m] *= keep[m];
      y_[m] *= keep[m];
    }
  }
  if (!push_re.empty()) {
    is_moving_ = true;
    for (std::size_t m = 0; m < static_cast<std::size_t>(count_); ++m) {
      v_[m] += push_re[m] - tilt_[m] * push_im[m];
      y_[m] += push_im[m] / damped_share_[m];
    }
  }
  if (++samples_ < kFeedSamples) return;
  samples_ = 0;
  if (coupled.is_moving() || is_moving_) exchange(coupled);
}

/// Flux [W] between mean energies of modes; ratio_log: log of the frequency ratio.
double Cascade::find_flux(double low_j, double high_j, double ratio_log) const noexcept {
  const auto drive = [this](double e) { return e * e * e / (1.0 + e / strong_j_); };
  return flux_per_j3_ * (drive(low_j) - drive(high_j)) / ratio_log;
}

/// Energy that the lowest band takes from the coupled modes [J].
double Cascade::feed(CoupledModes& coupled, const Band& band) noexcept {
  const int limit = coupled.get_limit(), top = std::max(1, static_cast<int>(kTopShare * limit));
  if (limit == 0) return 0.0;
  double energy = 0.0, freq = 0.0;
  for (int i = limit - top; i < limit; ++i) {
    energy += coupled.calc_mode_energy_j(i);
    freq += coupled_hz_[i] / top;
  }
  const double mean = energy / top, other = band.calc_mean_j();
  if (!(energy > kSmallestJ) || !(mean > other)) return 0.0;
  const double step_s = kFeedSamples * period_s_, modes = static_cast<double>(band.last - band.first);
  const double wanted = std::min({step_s * find_flux(mean, other, std::log(std::max(kBandRatio, band.freq_hz / freq))), kMostShare * energy,
                                  kEqualising * (mean - other) * top * modes / (top + modes)});
  if (!(wanted > kMinTransferShare * energy)) return 0.0;
  std::fill(share_.begin(), share_.end(), 0.0);
  std::fill(share_.begin() + (limit - top), share_.begin() + limit, wanted / energy);
  return coupled.take_velocity(share_);
}

/// Scales the modes of a band to its energy balance.
void Cascade::settle(Band& band) noexcept {
  if (band.in_j == 0.0 && band.out_j == 0.0) return;
  const double wanted = band.energy_j - band.out_j + band.in_j;
  double energy = 0.0;
  if (band.in_j > 0.0) {
    double square = 0.0;
    for (std::size_t m = band.first; m < band.last; ++m) {
      noise_[m] = 2.0 * base::to_unit(base::draw(chance_)) - 1.0;
      square += noise_[m] * noise_[m];
    }
    const double size = std::sqrt(2.0 * band.in_j / square);
    for (std::size_t m = band.first; m < band.last; ++m) v_[m] += size * noise_[m];
  }
  for (std::size_t m = band.first; m < band.last; ++m) energy += 0.5 * (v_[m] * v_[m] + y_[m] * y_[m]);
  const double scale = energy > 0.0 ? std::sqrt(wanted / energy) : 0.0;
  for (std::size_t m = band.first; m < band.last; ++m) {
    v_[m] *= scale;
    y_[m] *= scale;
  }
  is_moving_ = true;
}

void Cascade::exchange(CoupledModes& coupled) noexcept {
  for (Band& band : bands_) {
    double energy = 0.0;
    for (std::size_t m = band.first; m < band.last; ++m) energy += v_[m] * v_[m] + y_[m] * y_[m];
    band.energy_j = 0.5 * energy;
    band.in_j = band.out_j = 0.0;
  }
  const double step_s = kFeedSamples * period_s_;
  for (std::size_t b = 0; b < bands_.size(); ++b) {
    const bool is_last = b + 1 == bands_.size();
    Band* low = &bands_[b];
    Band* high = is_last ? nullptr : &bands_[b + 1];
    const double ratio_log = is_last ? std::log(kCutoffRatio) : std::log(high->freq_hz / low->freq_hz);
    double flux = step_s * find_flux(low->calc_mean_j(), is_last ? 0.0 : high->calc_mean_j(), ratio_log);
    if (flux < 0.0) {
      std::swap(low, high);
      flux = -flux;
    }
    double most = kMostShare * low->energy_j;
    if (high != nullptr) {
      const double a = static_cast<double>(low->last - low->first), c = static_cast<double>(high->last - high->first);
      most = std::min(most, kEqualising * (low->calc_mean_j() - high->calc_mean_j()) * a * c / (a + c));
    }
    flux = std::min(flux, most);
    if (!(flux > kMinTransferShare * low->energy_j)) continue;
    low->out_j += flux;
    if (high != nullptr)
      high->in_j += flux;
    else
      book_.lost_j += flux;
  }
  const double taken = feed(coupled, bands_.front());
  bands_.front().in_j += taken;
  book_.taken_j += taken;
  book_.gained_j += taken;
  for (Band& band : bands_) settle(band);
}

void Cascade::set_state(int i, double q, double velocity) noexcept {
  const std::size_t m = i;
  v_[m] = velocity;
  y_[m] = omega_[m] * q;
  is_moving_ = is_moving_ || q != 0.0 || velocity != 0.0;
}

void Cascade::reset() noexcept {
  std::fill(v_.begin(), v_.end(), 0.0);
  std::fill(y_.begin(), y_.end(), 0.0);
  book_ = {};
  samples_ = 0;
  chance_ = options_.seed;
  is_moving_ = false;
}

double Cascade::calc_energy_j() const noexcept {
  double energy = 0.0;
  for (std::size_t m = 0; m < static_cast<std::size_t>(count_); ++m) energy += v_[m] * v_[m] + y_[m] * y_[m];
  return 0.5 * energy;
}

std::size_t Cascade::calc_bytes() const noexcept {
  std::size_t bytes = sizeof(Cascade) + bands_.capacity() * sizeof(Band);
  for (const auto* values : {&vv_, &vy_, &yv_, &yy_, &tilt_, &damped_share_, &omega_, &v_, &y_, &noise_, &share_, &coupled_hz_})
    bytes += values->capacity() * sizeof(double);
  return bytes;
}

}  // namespace carillon::nonlinear
