// Method:     a mode of amplitude p and decay d has the exposure p^2 / 4 d. A pulse multiplies each mode by its spectrum; its own spectrum
//             times the transfer function of a pushed sphere gives the acceleration noise; exposures of both by A-weighted sums over
//             frequency (Parseval). Directional spread of a mode: its transfers at equal-area points of a spiral on a sphere.
// Source:     transform of sin^nu: Gradshteyn & Ryzhik 3.631.1; A-weighting: IEC 61672-1:2013; sphere: Morse & Ingard 1968, 7.2.
// Deviations: modes are treated as orthogonal, which beats violate over short times.
#include "runtime/scene/effects/levels.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>

#include "runtime/acoustics/radiation/gains.hpp"
#include "runtime/acoustics/radiation/transfers.hpp"
#include "runtime/base/vector.hpp"

namespace carillon::effects {
namespace {

using std::numbers::pi;

constexpr double kMaxCycles = 64.0;
constexpr int kStepsPerCycle = 128;
constexpr int kBands = 64;  // of the acceleration noise, even in log f

/// Gamma(7/4)^2 / (Gamma(7/4 + x) Gamma(7/4 - x)) without its sign.
double calc_hertz_spectrum(double x) {
  const double numerator = 2.0 * std::lgamma(1.75);
  if (x < 1.0) return std::exp(numerator - std::lgamma(1.75 + x) - std::lgamma(1.75 - x));
  // 1 / Gamma(7/4 - x) = Gamma(x - 3/4) sin(pi (x - 3/4)) / pi.
  const double sine = std::abs(std::sin(pi * (x - 0.75)));
  return std::exp(numerator - std::lgamma(1.75 + x) + std::lgamma(x - 0.75)) * sine / pi;
}

const std::vector<double>& get_hertz_table() {
  static const std::vector<double> table = [] {
    std::vector<double> values;
    for (int i = 0; i <= static_cast<int>(kMaxCycles) * kStepsPerCycle + 1; ++i) {
      values.push_back(calc_hertz_spectrum(static_cast<double>(i) / kStepsPerCycle));
    }
    return values;
  }();
  return table;
}

// Variance of the pulse of length 1 from the curvature of its spectrum: trigamma(7/4) / 2 pi^2.
constexpr double kTrigamma = 0.76410187;
constexpr double kVariance = kTrigamma / (2.0 * pi * pi);

}  // namespace

double calc_pulse_spectrum(events::PulseShape shape, double cycles) noexcept {
  if (!(cycles > 0.0)) return 1.0;
  if (shape == events::PulseShape::kGaussian) return std::exp(-2.0 * pi * pi * kVariance * cycles * cycles);
  if (cycles >= kMaxCycles) return 0.26886870 * std::pow(cycles, -2.5);  // Gamma(7/4)^2 / pi
  const double place = cycles * kStepsPerCycle;
  const std::size_t index = place;
  const double share = place - static_cast<double>(index);
  const std::vector<double>& table = get_hertz_table();
  return table[index] + share * (table[index + 1] - table[index]);
}

double calc_level_db(double exposure_pa2_s) noexcept {
  return 10.0 * std::log10(std::max(exposure_pa2_s, 0.0) / (kEarS * kReferencePa * kReferencePa));
}

BankLevels::BankLevels(const bank::Bank& bank, double rate_hz, double sphere_radius_m, const radiation::Transfers* transfers)
    : bank_(&bank), highest_hz_(std::min(kHighestHz, 0.5 * rate_hz)) {
  double lowest_hz = 0.0;
  for (std::size_t m = 0; m < bank.mode_count(); ++m) {
    const double freq = bank.freq_hz(m), omega = 2.0 * pi * freq, d = bank.decay_per_s[m];
    if (!(freq >= kLowestHz && freq < 0.5 * rate_hz)) continue;
    if (pushed_.empty()) lowest_hz = freq;
    pushed_.push_back({m, bank.radiation_gain[m] / (omega * omega)});
    if (!(freq < highest_hz_)) continue;
    const double slow = d > omega ? d - std::sqrt((d - omega) * (d + omega)) : d;
    modes_.push_back({static_cast<int>(m), freq, std::max(slow, 1e-9), std::abs(bank.radiation_gain[m]), calc_a_weight(freq)});
  }
  if (!bank.multipoles.is_empty()) {
    if (transfers != nullptr)
      find_spreads(*transfers);
    else
      find_spreads(radiation::Transfers(bank));
  }
  radius_m_ = sphere_radius_m > 0.0 ? sphere_radius_m : radiation::calc_sphere_radius_m(bank);
  // p(f) = rho c a / m T |s T / ((s T)^2 + 2 s T + 2)| J P(f) at 1 m, T = a / c; its exposure is twice the integral of |p|^2 over f > 0.
  const double turn = radius_m_ / bank::kSoundSpeedMs;
  const double gain = bank::kAirDensityKgM3 * bank::kSoundSpeedMs * radius_m_ / bank.rigid.mass_kg * turn;
  const double step = std::log(highest_hz_ / kLowestHz) / kBands;
  for (int band = 0; band < kBands; ++band) {
    const double freq = kLowestHz * std::exp(step * (band + 0.5)), x = 2.0 * pi * freq * turn;
    const double transfer = gain * x / std::hypot(2.0 - x * x, 2.0 * x) * calc_a_weight(freq);
    click_.push_back({freq, 2.0 * transfer * transfer * freq * step});
  }
  const double top = std::min(highest_hz_, 0.7 * lowest_hz);
  const double width = std::log(std::max(top / kLowestHz, 1.0)) / kBands;
  for (int band = 0; band < kBands && width > 0.0; ++band) {
    const double freq = kLowestHz * std::exp(width * (band + 0.5));
    const double transfer = 2.0 * pi * freq * calc_a_weight(freq);
    push_.push_back({freq, 2.0 * transfer * transfer * freq * width});
  }
}

/// In the far field; nulls count as 20 dB below the mean power of a mode, since other modes fill them.
void BankLevels::find_spreads(const radiation::Transfers& transfers) {
  constexpr int kDirections = 96;
  constexpr double kDeepest = 0.01;
  std::vector<std::int32_t> numbers;
  for (const Mode& mode : modes_) numbers.push_back(mode.index);
  std::vector<std::complex<float>> transfer(modes_.size());
  std::vector<double> power(modes_.size() * kDirections), mean(modes_.size());
  const double distance_m = 10.0 + 20.0 * transfers.get_radius_m();
  for (std::size_t i = 0; i < kDirections; ++i) {
    const double z = 1.0 - (2.0 * static_cast<double>(i) + 1.0) / kDirections, across = std::sqrt(1.0 - z * z);
    const double angle = pi * (3.0 - std::sqrt(5.0)) * static_cast<double>(i);
    const Vec3 direction{across * std::cos(angle), across * std::sin(angle), z};
    transfers.evaluate(transfers.get_centre_m() + distance_m * direction, numbers, transfer);
    for (std::size_t m = 0; m < modes_.size(); ++m) {
      power[m * kDirections + i] = static_cast<double>(std::norm(transfer[m]));
      mean[m] += power[m * kDirections + i] / kDirections;
    }
  }
  double all = 0.0;
  for (std::size_t m = 0; m < modes_.size(); ++m) {
    if (!(mean[m] > 0.0)) continue;
    double sum = 0.0, squares = 0.0;
    for (std::size_t i = 0; i < kDirections; ++i) {
      const double level = 10.0 * std::log10(std::max(power[m * kDirections + i] / mean[m], kDeepest));
      sum += level;
      squares += level * level;
    }
    sum /= kDirections;
    modes_[m].spread_db = std::sqrt(std::max(0.0, squares / kDirections - sum * sum));
    const double share = mean[m] * modes_[m].weight * modes_[m].weight;
    spread_db_ += share * modes_[m].spread_db;
    all += share;
  }
  if (all > 0.0) spread_db_ /= all;
}

bool BankLevels::calc_projections(std::int32_t triangle, const Vec3& barycentric, const Vec3& direction,
                                  std::vector<double>& projections) const {
  if (triangle < 0 || triangle >= std::ssize(bank_->triangles)) return false;
  projections.assign(modes_.size(), 0.0);
  const auto& corners = bank_->triangles[triangle];
  for (std::size_t i = 0; i < modes_.size(); ++i) {
    double sum = 0.0;
    for (std::size_t corner = 0; corner < 3; ++corner) {
      const Vec3 phi = bank_->shape_at(corners[corner], modes_[i].index);
      sum += barycentric[corner] * (phi[0] * direction[0] + phi[1] * direction[1] + phi[2] * direction[2]);
    }
    projections[i] = std::abs(sum);
  }
  return true;
}

double BankLevels::calc_pushed_pa2_s(std::int32_t triangle, const Vec3& barycentric, const Vec3& impulse_n_s, events::PulseShape shape,
                                     double duration_s) const {
  if (triangle < 0 || triangle >= std::ssize(bank_->triangles)) return 0.0;
  const auto& corners = bank_->triangles[triangle];
  double sum = 0.0;
  for (const PushedMode& mode : pushed_) {
    for (std::size_t corner = 0; corner < 3; ++corner) {
      const Vec3 phi = bank_->shape_at(corners[corner], mode.index);
      sum += mode.gain_s2 * barycentric[corner] * (phi[0] * impulse_n_s[0] + phi[1] * impulse_n_s[1] + phi[2] * impulse_n_s[2]);
    }
  }
  double exposure = 0.0;
  for (const Band& band : push_) {
    const double pulse = calc_pulse_spectrum(shape, band.freq_hz * duration_s);
    exposure += band.pa2_s * pulse * pulse;
  }
  return exposure * sum * sum;
}

ClickLevels BankLevels::calc_click_levels(double impulse_n_s, events::PulseShape shape, double duration_s) const {
  ClickLevels levels;
  double square_hz = 0.0;
  for (const Band& band : click_) {
    const double pulse = calc_pulse_spectrum(shape, band.freq_hz * duration_s);
    const double flat = band.pa2_s * impulse_n_s * impulse_n_s;
    levels.pa2_s += flat * pulse * pulse;
    levels.pulse_loss_pa2_s += flat * (1.0 - pulse) * (1.0 - pulse);
    square_hz += flat * pulse * pulse * band.freq_hz * band.freq_hz;
  }
  if (levels.pa2_s > 0.0) levels.mean_hz = std::sqrt(square_hz / levels.pa2_s);
  return levels;
}

StrikeLevels calc_strike_levels(const BankLevels& bank, std::span<const double> projections, events::PulseShape shape, double duration_s,
                                std::vector<double>& amplitude_pa) {
  StrikeLevels levels;
  const std::span<const BankLevels::Mode> modes = bank.get_modes();
  amplitude_pa.assign(modes.size(), 0.0);
  double square_hz = 0.0;
  for (std::size_t i = 0; i < modes.size(); ++i) {
    const BankLevels::Mode& mode = modes[i];
    const double pulse = calc_pulse_spectrum(shape, mode.freq_hz * duration_s);
    const double ideal = mode.gain_pa * projections[i];
    amplitude_pa[i] = ideal * pulse;
    const double weighed = ideal * mode.weight;
    const double flat = weighed * weighed / (4.0 * mode.decay_per_s);
    levels.modal_pa2_s += flat * pulse * pulse;
    levels.pulse_loss_pa2_s += flat * (1.0 - pulse) * (1.0 - pulse);
    square_hz += flat * pulse * pulse * mode.freq_hz * mode.freq_hz;
  }
  if (levels.modal_pa2_s > 0.0) levels.mean_hz = std::sqrt(square_hz / levels.modal_pa2_s);
  return levels;
}

}  // namespace carillon::effects
