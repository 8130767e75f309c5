// Method:     the nonlinear force is a kick at each sample, between which modes rotate exactly. Verlet's kick is the gradient of V at the
//             sample. Its energy is evaluated at the sample, with the two second-order terms by which kicked motion conserves a modified
//             energy (Hairer, Lubich, Wanner, IX.8): with A the linear motion and d/dt along it,
//     H = A + V + k^2 / 12 d/dt (v . grad V) - k^2 / 24 |grad V|^2,    d/dt (v . grad V) = v . d grad V / dt - lambda q . grad V
// and d grad V / dt from the previous sample. Guard: the auxiliary variable psi stands for sqrt(2 (V + rest)); the kick is g psi, g = grad
// V / sqrt(2 (V + rest)), psi the mean of both samples, and psi changes by k g . v, so that energy is exchanged exactly for any g. One
// evaluation of V per sample in both cases. A push is the response to forces of uncoupled modes. Its velocity acts as the kick does, half
// before and half after; its amplitude at once, and the change of V counts as work.
// Source:     Bilbao, Ducceschi and Zama, J. Comput. Phys. 472 (2023) 111697 (auxiliary variable); docs/equations.md E12.
// Deviations: linear parts are exact, and kicks act on them; psi is reset by each Verlet step, and relaxes to the energy that it stands for
//             within relaxation_s, with at most the energy lost to damping in the step.
#include "runtime/synth/nonlinear/coupled_modes.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "runtime/base/error.hpp"

namespace carillon::nonlinear {
namespace {

constexpr double kTiny = 1e-200;     // J: avoids 0 / 0 at rest
constexpr double kRestMargin = 1.5;  // rest energy over the energy stored by a curved body
constexpr double kCredit = 0.1;      // of the damping losses, for a bound below the energy
constexpr double kStale = 1.05;      // a bound above this many times the energy falls
constexpr double kStaleS = 0.05;     // within this time
constexpr double kLargestJ = 1e60;

constexpr int pad(int count) noexcept { return (count + kUnit - 1) / kUnit * kUnit + kUnit; }

}  // namespace

/// Sums at a sample, after rotation and push, before the kick.
struct CoupledModes::Step {
  double potential_j = 0.0;
  double root = 0.0;        // sqrt(2 (V + rest))
  TurnSums turn{};          // with half of the push
  GradientSums gradient{};  // likewise
  double lost_j = 0.0;      // damping loss of the rotation
  double work_j = 0.0;      // work of the push without its velocity
  bool is_pushed = false;
  double push_speed = 0.0, push_gradient = 0.0, push_square = 0.0;  // half the push times v, times the gradient, squared
};

CoupledModes::CoupledModes(const bank::QuarticEnergy& energy, std::span<const ModeConstants> modes, double rate_hz,
                           const CoupledOptions& options)
    : kernels_(&get_kernels()),
      evaluator_(
          [&]() -> const bank::QuarticEnergy& {
            if (!(rate_hz > 0.0) || !std::isfinite(rate_hz))
              throw InputError("coupled modes: the sample rate must be a positive number of Hz");
            if (const std::string fault = bank::find_size_fault(energy); energy.is_empty() || !fault.empty())
              throw InputError("coupled modes: " + (fault.empty() ? std::string("there are none") : fault));
            if (modes.size() != energy.mode_count())
              throw InputError(fmt::format("coupled modes: {} constants for {} modes", modes.size(), energy.mode_count()));
            const auto is_finite = [](const auto& values) {
              return std::all_of(values.begin(), values.end(), [](auto x) { return std::isfinite(x); });
            };
            if (!is_finite(energy.rows) || !is_finite(energy.gradient) || !is_finite(energy.stress) || !is_finite(energy.weight) ||
                !is_finite(energy.linear) || !(energy.rest_energy_j >= 0.0) || !std::isfinite(energy.rest_energy_j))
              throw InputError("coupled modes: a number of the nonlinear energy is not finite");
            return energy;
          }(),
          *kernels_),
      options_(options),
      period_s_(1.0 / rate_hz),
      count_(static_cast<int>(modes.size())),
      padded_(pad(count_)),
      limit_(count_),
      is_curved_(!energy.linear.empty()),
      first_rest_j_(is_curved_ ? energy.rest_energy_j : 0.0) {
  for (auto* values : {&half_tangent_, &sine_, &keep_, &tilt_, &stiffness_, &to_q_, &restoring_, &omega_, &re_, &im_, &middle_, &gradient_,
                       &before_, &shift_, &lift_})
    values->assign(padded_, 0.0);
  q_.assign(padded_, 0.0F);
  for (std::size_t m = 0; m < modes.size(); ++m) {
    const double lambda = modes[m].eigenvalue_rad2_s2, d = modes[m].decay_per_s;
    const double omega = std::sqrt(lambda), damped = std::sqrt((omega - d) * (omega + d)), angle = damped * period_s_;
    if (!(d >= 0.0) || !(damped > 0.0) || !std::isfinite(damped) || !(omega * period_s_ < std::numbers::pi))
      throw InputError(fmt::format("coupled modes: mode {} has {:.6g} Hz and a decay of {:.6g} 1/s; it must oscillate, below {:.6g} Hz", m,
                                   omega / (2.0 * std::numbers::pi), d, 0.5 * rate_hz));
    half_tangent_[m] = std::tan(0.5 * angle);
    sine_[m] = std::sin(angle);
    keep_[m] = std::exp(-d * period_s_);
    tilt_[m] = d / damped;
    stiffness_[m] = lambda / (damped * damped);
    restoring_[m] = lambda / damped;
    omega_[m] = damped;
    to_q_[m] = evaluator_.get_scale() / damped;
  }
  start();
}

/// Sets the state at rest.
void CoupledModes::start() noexcept {
  rest_j_ = first_rest_j_;
  psi_ = std::sqrt(2.0 * rest_j_);
  linear_j_ = bound_j_ = work_j_ = 0.0;
  has_before_ = false;
}

void CoupledModes::reset() noexcept {
  for (auto* values : {&re_, &im_, &middle_, &gradient_, &before_}) std::fill(values->begin(), values->end(), 0.0);
  start();
}

/// H of the states at the sample, whose kick is recomputed: half of it follows `middle`.
double CoupledModes::restart() noexcept {
  for (std::size_t n = 0; n < static_cast<std::size_t>(count_); ++n) q_[n] = static_cast<float>(to_q_[n] * im_[n]);
  const double potential = evaluator_.evaluate(q_.data(), im_.data(), to_q_.data(), gradient_.data());
  double linear = 0.0, book = potential;
  for (std::size_t n = 0; n < static_cast<std::size_t>(count_); ++n) {
    const double swing = stiffness_[n] * im_[n] * im_[n], v = middle_[n] - tilt_[n] * im_[n], kick = 0.5 * period_s_ * gradient_[n];
    re_[n] = middle_[n] - kick;
    book += 0.5 * (v * v + swing);
    linear += 0.5 * ((v - kick) * (v - kick) + swing);
  }
  linear_j_ = linear;
  raise_rest(potential);
  psi_ = std::sqrt(std::max(0.0, 2.0 * (book - linear + rest_j_)));
  has_before_ = false;
  return book;
}

void CoupledModes::set_state(int i, double q, double velocity) noexcept {
  const std::size_t m = i;
  const double before = restart();
  im_[m] = omega_[m] * q;
  middle_[m] = velocity + tilt_[m] * im_[m];
  const double work = restart() - before;
  bound_j_ += work;
  work_j_ += work;
}

double CoupledModes::take_velocity(std::span<const double> share) noexcept {
  double taken = 0.0;
  for (std::size_t m = 0; m < share.size() && m < static_cast<std::size_t>(count_); ++m) {
    const double v = re_[m] - tilt_[m] * im_[m], change = share[m] * v;
    taken += change * (v - 0.5 * change);
    re_[m] -= change;
    middle_[m] -= change;
  }
  linear_j_ = std::max(0.0, linear_j_ - taken);
  bound_j_ -= taken;
  return taken;
}

double CoupledModes::calc_mode_energy_j(int i) const noexcept {
  const std::size_t m = i;
  const double v = re_[m] - tilt_[m] * im_[m];
  return 0.5 * (v * v + stiffness_[m] * im_[m] * im_[m]);
}

double CoupledModes::calc_tension_rad_s() const noexcept {
  double virial = 0.0, squares = 0.0;
  for (std::size_t m = 0; m < static_cast<std::size_t>(limit_); ++m) {
    const double q = im_[m] / omega_[m];
    virial += q * gradient_[m];
    squares += q * im_[m];
  }
  return squares > 0.0 ? virial / squares : 0.0;
}

void CoupledModes::set_limit(int modes) noexcept {
  modes = std::clamp(modes, 0, count_);
  if (modes == limit_) return;
  limit_ = modes;
  evaluator_.set_count(modes);
  for (int i = 0; i < count_; ++i) to_q_[i] = i < modes ? evaluator_.get_scale() / omega_[i] : 0.0;
  // The balance continues with the energy of the modes still coupled.
  const double before = get_energy_j();
  bound_j_ += restart() - before;
}

/// Keeps V + rest positive: V is at least minus the linear energy, which the bound limits up to the tolerance.
void CoupledModes::raise_rest(double potential_j) noexcept {
  if (!is_curved_) return;
  const double wanted = std::max(kRestMargin * std::max(bound_j_, linear_j_), -kRestMargin * potential_j);
  if (!(wanted > rest_j_)) return;
  const double more = 2.0 * wanted - rest_j_;
  psi_ = std::sqrt(psi_ * psi_ + 2.0 * more);
  rest_j_ += more;
}

/// Adds the amplitudes of a push and half of its velocities; returns the work of the amplitudes against the linear forces.
double CoupledModes::push_amplitudes(const double* push_re, const double* push_im) noexcept {
  double work = 0.0;
  for (std::size_t m = 0; m < static_cast<std::size_t>(count_); ++m) {
    const double rise = push_im[m];
    work += stiffness_[m] * rise * (im_[m] + 0.5 * rise);
    im_[m] += rise;
    lift_[m] = rise / omega_[m];
    shift_[m] = 0.5 * (push_re[m] - tilt_[m] * rise);
    re_[m] += tilt_[m] * rise + shift_[m];
    q_[m] = static_cast<float>(to_q_[m] * im_[m]);
  }
  return work;
}

/// Damping by contacts of the rotated states.
void CoupledModes::damp(const double* keep, Step& step) noexcept {
  double after = 0.0;
  for (std::size_t m = 0; m < static_cast<std::size_t>(count_); ++m) {
    re_[m] *= keep[m];
    im_[m] *= keep[m];
    const double v = re_[m] - tilt_[m] * im_[m];
    after += v * v + stiffness_[m] * im_[m] * im_[m];
  }
  step.lost_j += std::max(0.0, 0.5 * (step.turn.speed + step.turn.amplitude - after));
}

void CoupledModes::advance(const double* push_re, const double* push_im, const double* keep) noexcept {
  ++counters_.steps;
  const bool is_pushed = push_re != nullptr;
  if (!is_pushed && !is_moving()) return;
  Step step;
  const TurnTable table{half_tangent_.data(), sine_.data(), keep_.data(), tilt_.data(), stiffness_.data(), to_q_.data()};
  step.turn = kernels_->turn(table, padded_ - kUnit, re_.data(), im_.data(), q_.data());
  step.lost_j = std::max(0.0, 0.5 * (step.turn.before - step.turn.speed - step.turn.amplitude));
  if (keep != nullptr) damp(keep, step);
  step.is_pushed = is_pushed;
  if (is_pushed) step.work_j = push_amplitudes(push_re, push_im);
  std::swap(gradient_, before_);
  step.potential_j = evaluator_.evaluate(q_.data(), im_.data(), to_q_.data(), gradient_.data());
  if (!has_before_) std::copy(gradient_.begin(), gradient_.end(), before_.begin());
  has_before_ = true;
  if (is_pushed) {
    double along = 0.0, speed = 0.0, amplitude = 0.0;
    for (std::size_t m = 0; m < static_cast<std::size_t>(count_); ++m) {
      const double v = re_[m] - tilt_[m] * im_[m];
      along += gradient_[m] * lift_[m];
      speed += v * v;
      amplitude += stiffness_[m] * im_[m] * im_[m];
      step.push_speed += shift_[m] * v;
      step.push_gradient += shift_[m] * gradient_[m];
      step.push_square += shift_[m] * shift_[m];
    }
    step.turn.speed = speed;
    step.turn.amplitude = amplitude;
    if (!is_curved_) along = std::min(along, step.potential_j);  // V was not negative before
    const double square = std::max(0.0, psi_ * psi_ + 2.0 * along);
    step.work_j += 0.5 * (square - psi_ * psi_);
    psi_ = std::sqrt(square);
  }
  step.gradient =
      kernels_->compare(padded_ - kUnit, re_.data(), im_.data(), tilt_.data(), restoring_.data(), before_.data(), gradient_.data());
  if (!(std::abs(step.potential_j) < kLargestJ) || !(step.gradient.square < kLargestJ)) return take_linear(step);
  raise_rest(step.potential_j);
  step.root = std::sqrt(std::max(0.0, 2.0 * (step.potential_j + rest_j_)) + kTiny);
  if (options_.integrator != Integrator::kAuxiliary && try_verlet(step)) return;
  take_auxiliary(step);
}

/// Kick of `pull` gradients, and the second half of the push.
void CoupledModes::finish(const Step& step, double pull) noexcept {
  const double k = period_s_, turned = step.turn.speed, amplitude = step.turn.amplitude;
  kernels_->kick(padded_ - kUnit, 0.5 * k * pull, gradient_.data(), re_.data(), middle_.data());
  double speed = turned - 2.0 * k * pull * step.gradient.speed_gradient + k * k * pull * pull * step.gradient.square;
  double work = step.work_j;
  if (step.is_pushed) {
    const double half = step.push_speed - k * pull * step.push_gradient;  // times the velocity after the kick
    speed += 2.0 * half + step.push_square;
    work += 2.0 * step.push_speed - k * pull * step.push_gradient;
    for (std::size_t m = 0; m < static_cast<std::size_t>(count_); ++m) {
      re_[m] += shift_[m];
      middle_[m] += shift_[m];  // at the sample the whole push has acted
    }
  }
  linear_j_ = 0.5 * (std::max(0.0, speed) + amplitude);
  bound_j_ += work;
  work_j_ += work;
}

/// A bound below the energy (rounding, guard) rises with the damping losses; one far above falls.
void CoupledModes::settle_bound(double book_j, double lost_j) noexcept {
  if (book_j > bound_j_)
    bound_j_ -= (1.0 - kCredit) * lost_j;
  else if (bound_j_ -= lost_j; bound_j_ > kStale * book_j)
    bound_j_ -= (bound_j_ - kStale * book_j) * std::min(1.0, period_s_ / kStaleS);
}

bool CoupledModes::try_verlet(const Step& step) noexcept {
  const double k = period_s_;
  const GradientSums& g = step.gradient;
  // As in finish(), with a pull of 1.
  double speed = step.turn.speed - 2.0 * k * g.speed_gradient + k * k * g.square, work = step.work_j;
  if (step.is_pushed) {
    speed += 2.0 * (step.push_speed - k * step.push_gradient) + step.push_square;
    work += 2.0 * step.push_speed - k * step.push_gradient;
  }
  const double middle = step.turn.speed - k * g.speed_gradient + 0.25 * k * k * g.square;
  // (v - k G / 2) . (G - P) / k
  const double rise = (g.speed_gradient - g.speed_before) / k - 0.5 * (g.square - g.gradient_before);
  const double second = k * k * ((rise - g.restoring) / 12.0 - g.square / 24.0);
  const double book = 0.5 * (middle + step.turn.amplitude) + step.potential_j + second, linear = 0.5 * (speed + step.turn.amplitude);
  if (options_.integrator == Integrator::kGuarded) {
    const double most = (1.0 + options_.tolerance) * (bound_j_ + work - step.lost_j);
    if (!(book <= most && linear <= most + rest_j_)) return false;
  }
  finish(step, 1.0);
  psi_ = std::sqrt(std::max(0.0, 2.0 * (book - linear_j_ + rest_j_)));
  settle_bound(book, step.lost_j);
  return true;
}

void CoupledModes::take_auxiliary(const Step& step) noexcept {
  ++counters_.guarded;
  const double k = period_s_;
  if (options_.relaxation_s > 0.0) {
    // Half a sample earlier, as psi.
    const double root = std::max(0.0, step.root - 0.5 * k * step.gradient.speed_gradient / step.root);
    const double most = std::sqrt(psi_ * psi_ + 2.0 * step.lost_j);
    psi_ = std::clamp(psi_ - (psi_ - root) * std::min(1.0, k / options_.relaxation_s), -most, most);
  }
  const double square = step.gradient.square / (step.root * step.root);
  const double along = step.gradient.speed_gradient / step.root;
  const double middle = (along - 0.5 * k * square * psi_) / (1.0 + 0.25 * k * k * square);  // g . v at the middle
  const double pull = (psi_ + 0.5 * k * middle) / step.root;
  psi_ += k * middle;
  finish(step, pull);
  settle_bound(get_energy_j(), step.lost_j);
}

/// Step without the nonlinear force; psi is kept, so the balance is kept.
void CoupledModes::take_linear(const Step& step) noexcept {
  ++counters_.linear;
  std::fill(gradient_.begin(), gradient_.end(), 0.0);
  Step soft = step;
  soft.gradient = {};
  soft.push_gradient = 0.0;
  finish(soft, 0.0);
  bound_j_ -= step.lost_j;
  has_before_ = false;
}

std::size_t CoupledModes::calc_bytes() const noexcept {
  std::size_t bytes = evaluator_.calc_bytes() + q_.capacity() * sizeof(float);
  for (const auto* values : {&half_tangent_, &sine_, &keep_, &tilt_, &stiffness_, &to_q_, &restoring_, &omega_, &re_, &im_, &middle_,
                             &gradient_, &before_, &shift_, &lift_})
    bytes += values->capacity() * sizeof(double);
  return bytes;
}

}  // namespace carillon::nonlinear
