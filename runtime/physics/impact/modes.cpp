// Method: responses g (to a unit force) and b = g' (to a unit impulse) of one oscillator in closed form; a = 1 - w^2 g, c = -w^2 b, e = 1 -
// 2 d b - w^2 g follow from the equation of motion. Small w h and d h use the power series of g, which has no cancellation.
// Source: the equation of the damped oscillator; the tail follows the residual flexibility of component mode synthesis (MacNeal 1971), with
// the constant modal density of plates (Cremer, Heckl, Structure-Borne Sound, on point mobilities). Residual flexibility is a spring; this
// tail also absorbs the energy of a short pulse above the band.
#include "runtime/physics/impact/modes.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace carillon::impact {
namespace {

constexpr double kTailRatio = 1.12;
constexpr double kTailDecay = 0.15;
constexpr std::size_t kMaxPropagators = 24;

struct Answer {
  double g, b;  // displacement after a unit force over h [s^2], after a unit impulse [s]
};

/// g'' + 2 d g' + w^2 g = 1, g(0) = g'(0) = 0: the power series in h.
Answer calc_by_series(double w, double d, double h) {
  double before = 0.0, term = 0.5 * h * h, g = term, hb = 2.0 * term;
  for (int k = 1; k < 30; ++k) {  // term: of h^(k+1)
    const double next = -(2.0 * d * h * (k + 1) * term + w * w * h * h * before) / ((k + 2.0) * (k + 1.0));
    before = term;
    term = next;
    g += term;
    hb += (k + 2.0) * term;
  }
  return {g, hb / h};
}

double calc_sinc(double x) { return std::abs(x) < 1e-4 ? 1.0 - x * x / 6.0 : std::sin(x) / x; }

Answer calc_answer(double w, double d, double h) {
  if (std::max(w, d) * h < 0.5) return calc_by_series(w, d, h);
  const double discriminant = (w - d) * (w + d);
  if (discriminant >= 0.0) {
    const double o = std::sqrt(discriminant), fall = std::exp(-d * h), s = h * calc_sinc(o * h);
    return {(1.0 - fall * (std::cos(o * h) + d * s)) / (w * w), fall * s};
  }
  // Two real decays, slow * fast = w^2.
  const double k = std::sqrt(-discriminant), fast = d + k, slow = w * w / fast;
  const double to_slow = slow * h > 1e-300 ? -std::expm1(-slow * h) / slow : h, to_fast = -std::expm1(-fast * h) / fast;
  if (2.0 * k * h < 1e-3) {  // near critical damping: b from its sinh, g from the equation of motion
    const double fall = std::exp(-d * h), s = h * (1.0 + k * k * h * h / 6.0), c = 1.0 + 0.5 * k * k * h * h;
    return {(1.0 - fall * (c + d * s)) / (w * w), fall * s};
  }
  return {(to_slow - to_fast) / (2.0 * k), std::exp(-slow * h) * -std::expm1(-2.0 * k * h) / (2.0 * k)};
}

std::shared_ptr<const Propagator> find_or_make(std::map<int, std::shared_ptr<const Propagator>>& kept, std::span<const double> omega,
                                               std::span<const double> decay, int k) {
  const auto found = kept.find(k);
  if (found != kept.end()) return found->second;
  if (kept.size() >= kMaxPropagators) kept.erase(kept.begin()->first < k ? kept.begin() : std::prev(kept.end()));
  return kept[k] = std::make_shared<const Propagator>(make_propagator(omega, decay, get_step(k)));
}

}  // namespace

Propagator make_propagator(std::span<const double> omega, std::span<const double> decay, double h_s) {
  const std::size_t n = omega.size(), padded = (n + kLanes - 1) / kLanes * kLanes;
  Propagator p;
  for (auto* x : {&p.a, &p.b, &p.c, &p.e, &p.g}) x->assign(padded, 0.0);
  for (std::size_t i = 0; i < n; ++i) {
    const double w = omega[i], d = decay[i];
    const Answer one = calc_answer(w, d, h_s);
    p.g[i] = one.g;
    p.b[i] = one.b;
    p.a[i] = 1.0 - w * w * one.g;
    p.c[i] = -w * w * one.b;
    p.e[i] = p.a[i] - 2.0 * d * one.b;
  }
  return p;
}

double get_step(int k) { return std::exp2(0.25 * k); }
int find_step(double h_s) {
  const int k = static_cast<int>(std::floor(4.0 * std::log2(h_s)));
  return get_step(k + 1) <= h_s ? k + 1 : k;
}

Modes::Modes(std::span<const double> omega, std::span<const double> decay, double band_rad_s)
    : omega_(omega.begin(), omega.end()), decay_(decay.begin(), decay.end()), band_(band_rad_s) {
  if (omega.size() != decay.size()) throw std::invalid_argument("impact: numbers of frequencies and decays differ");
  for (const auto& values : {omega_, decay_})
    if (!std::all_of(values.begin(), values.end(), [](double x) { return std::isfinite(x) && x >= 0.0; }))
      throw std::invalid_argument("impact: frequencies and decays must be finite and non-negative");
  if (!(band_ > 0.0)) band_ = omega_.empty() ? 0.0 : *std::max_element(omega_.begin(), omega_.end());
  const auto count = [&](double low, double high) {
    return std::count_if(omega_.begin(), omega_.end(), [&](double w) { return w > low && w <= high; });
  };
  const auto last = count(0.5 * band_, band_), before = count(0.25 * band_, 0.5 * band_);
  has_tail_ = last >= 8 && static_cast<double>(last) <= 2.5 * static_cast<double>(before);
  if (!has_tail_) return;
  for (int j = 0; j < kTailModes; ++j) {
    const double low = band_ * std::pow(kTailRatio, j), high = kTailRatio * low;
    tail_omega_.push_back(std::sqrt(low * high));
    tail_decay_.push_back(kTailDecay * (high - low));
  }
}

std::shared_ptr<const Propagator> Modes::find_propagator(int k) const { return find_or_make(kept_, omega_, decay_, k); }
std::shared_ptr<const Propagator> Modes::find_tail_propagator(int k) const { return find_or_make(kept_tail_, tail_omega_, tail_decay_, k); }

double Modes::calc_tail_compliance(std::span<const double> phi) const {
  if (!has_tail_) return 0.0;
  double sum = 0.0;
  for (std::size_t i = 0; i < omega_.size(); ++i)
    if (omega_[i] > 0.5 * band_ && omega_[i] <= band_) sum += phi[i] * phi[i] / (omega_[i] * omega_[i]);
  return sum;
}

std::vector<double> Modes::calc_tail_shapes(double compliance) const {
  std::vector<double> phi;
  for (int j = 0; j < kTailModes && has_tail_; ++j) {
    const double low = band_ * std::pow(kTailRatio, j), w = tail_omega_[j];
    // The last mode also represents everything above it.
    const double share = band_ / low * (j + 1 < kTailModes ? 1.0 - 1.0 / kTailRatio : 1.0);
    phi.push_back(w * std::sqrt(compliance * share));
  }
  return phi;
}

double Modes::calc_energy(std::span<const double> q, std::span<const double> q_dot) const {
  double sum = 0.0;
  for (std::size_t i = 0; i < omega_.size(); ++i) sum += 0.5 * (q_dot[i] * q_dot[i] + omega_[i] * omega_[i] * q[i] * q[i]);
  return sum;
}

void Modes::move_freely(std::span<double> q, std::span<double> q_dot, double time_s) const {
  if (!(time_s > 0.0)) return;
  for (std::size_t i = 0; i < omega_.size(); ++i) {
    const double w = omega_[i], d = decay_[i];
    const Answer one = calc_answer(w, d, time_s);
    const double a = 1.0 - w * w * one.g, x = a * q[i] + one.b * q_dot[i];
    q_dot[i] = -w * w * one.b * q[i] + (a - 2.0 * d * one.b) * q_dot[i];
    q[i] = x;
  }
}

void Modes::turn(std::span<double> q, std::span<double> q_dot, double time_s) const {
  for (std::size_t i = 0; i < omega_.size(); ++i) {
    const double c = std::cos(omega_[i] * time_s), s = std::sin(omega_[i] * time_s), before = q[i];
    q[i] = omega_[i] > 0.0 ? c * before + s / omega_[i] * q_dot[i] : before + time_s * q_dot[i];
    q_dot[i] = c * q_dot[i] - omega_[i] * s * before;
  }
}

}  // namespace carillon::impact
