// Modes of a body that moves by a thickness and more: they become stiffer, and pass energy to each other.
//
//   nonlinear::CoupledModes modes(bank.quartic, constants, 48000.0);
//   modes.step(push_re, push_im);  // to the next sample, with what forces did in between
//   pressure += gain[i] * modes.get_velocity(i);
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "runtime/bank/quartic_energy.hpp"
#include "runtime/synth/nonlinear/evaluator.hpp"

namespace carillon::nonlinear {

/// Of a coupled mode as it swings alone and softly.
struct ModeConstants {
  double eigenvalue_rad2_s2 = 0.0;
  double decay_per_s = 0.0;
};

/// How a sample follows from the one before.
enum class Integrator {
  kGuarded,    // Verlet, while its energy is what forces have put in; else kAuxiliary
  kAuxiliary,  // scalar auxiliary variable: the energy is kept to rounding, the pitch of strong motion less exactly
  kVerlet,     // for comparisons: may blow up
};

struct CoupledOptions {
  Integrator integrator = Integrator::kGuarded;
  double relaxation_s = 0.01;  // in which the auxiliary variable goes back to the root of the energy that it stands for; 0: never
  double tolerance = 0.02;     // by which Verlet's energy may pass what forces have put in
};

struct CoupledCounters {
  std::int64_t steps = 0;
  std::int64_t guarded = 0;  // of them, those in which the guard took the step
  std::int64_t linear = 0;   // those in which the energy could not be held in single precision: motion continued without its force
};

/// The coupled modes of a bank in motion. A mode's state is as in synth::Voice: re = q' + d q, im = omega_d q, omega_d^2 = lambda - d^2,
/// which turns and shrinks by itself: softly, it is the linear mode exactly. Invariant: the book
///   H = sum of (q'^2 + lambda q^2) / 2 + V(q)
/// is at most (1 + tolerance) of what pushes have put in less what damping took, whatever the energy and the blows. docs/equations.md E12.
/// Memory is taken in the constructor only; one thread at a time; nothing throws but the constructor. Denormal numbers slow it down: flush
/// them to zero.
class CoupledModes {
 public:
  /// `modes`: of each coupled mode, in the order of the energy. Throws InputError when the sizes disagree, when a mode does not swing
  /// (decay at or above sqrt(lambda)) or does so at the Nyquist frequency or above, or when a number is not finite.
  CoupledModes(const bank::QuarticEnergy& energy, std::span<const ModeConstants> modes, double rate_hz, const CoupledOptions& options = {});

  /// To the next sample, in which no force acts. [audio-thread]
  void step() noexcept { advance(nullptr, nullptr, nullptr); }
  /// The same with forces: what each mode at rest, alone, would have at this sample by them. (N) each. [audio-thread]
  void step(std::span<const double> push_re, std::span<const double> push_im) noexcept { advance(push_re.data(), push_im.data(), nullptr); }
  /// The same with contacts that damp: before the push, the state of each mode is multiplied by `keep`, 0 to 1. [audio-thread]
  void step(std::span<const double> push_re, std::span<const double> push_im, std::span<const double> keep) noexcept {
    advance(push_re.data(), push_im.data(), keep.data());
  }

  int get_count() const noexcept { return count_; }
  /// State of mode i at the sample: re and im, in the middle of what the nonlinear force does there.
  double get_re(int i) const noexcept { return middle_[i]; }
  double get_im(int i) const noexcept { return im_[i]; }
  double get_velocity(int i) const noexcept {
    const std::size_t m = i;
    return middle_[m] - tilt_[m] * im_[m];
  }
  /// q [m kg^1/2].
  double get_amplitude(int i) const noexcept { return im_[i] / omega_[i]; }

  /// Sets a mode, by amplitude and velocity. What it has of energy counts as put in. Not between samples of a blow. [audio-thread]
  void set_state(int i, double q, double velocity) noexcept;
  /// Takes a share of each velocity, 0 to 1, and with it energy [J], which is returned and is in the book no more. (N). Between two
  /// samples. [audio-thread]
  double take_velocity(std::span<const double> share) noexcept;
  /// (lambda q^2 + q'^2) / 2 of mode i [J], half a sample after the sample.
  double calc_mode_energy_j(int i) const noexcept;
  /// tau [rad/s], by which the nonlinear force is at this moment that of a mean tension: a tension makes lambda_i greater by tau omega_i,
  /// as it does in a plate that bends, where omega_i grows as the square of the wave number. q . grad V over the sum of omega_i q_i^2;
  /// below 0 of a curved body that softens. [audio-thread]
  double calc_tension_rad_s() const noexcept;
  /// Only the first `modes` are coupled from now on; the others continue as linear modes, from where they are. [audio-thread]
  void set_limit(int modes) noexcept;
  int get_limit() const noexcept { return limit_; }
  /// Silence: no motion, no energy, no memory of it. [audio-thread]
  void reset() noexcept;

  /// H [J], half a sample after the sample.
  double get_energy_j() const noexcept { return linear_j_ + 0.5 * psi_ * psi_ - rest_j_; }
  /// What pushes have put in, less what damping took.
  double get_bound_j() const noexcept { return bound_j_; }
  /// What pushes have put in since the start or the last reset().
  double get_work_j() const noexcept { return work_j_; }
  bool is_moving() const noexcept { return linear_j_ > 0.0; }
  const CoupledCounters& get_counters() const noexcept { return counters_; }
  std::size_t calc_bytes() const noexcept;

 private:
  struct Step;  // what is known of the sample before it is decided
  void advance(const double* push_re, const double* push_im, const double* keep) noexcept;
  void damp(const double* keep, Step& step) noexcept;
  double push_amplitudes(const double* push_re, const double* push_im) noexcept;
  void raise_rest(double potential_j) noexcept;
  bool try_verlet(const Step& step) noexcept;
  void take_auxiliary(const Step& step) noexcept;
  void take_linear(const Step& step) noexcept;
  void finish(const Step& step, double pull) noexcept;
  void settle_bound(double book_j, double lost_j) noexcept;
  void start() noexcept;
  double restart() noexcept;

  const CoupledKernels* kernels_;
  Evaluator evaluator_;
  CoupledOptions options_;
  double period_s_ = 0.0;
  int count_ = 0, padded_ = 0, limit_ = 0;
  bool is_curved_ = false;
  double first_rest_j_ = 0.0;
  std::vector<double> half_tangent_, sine_, keep_, tilt_, stiffness_, to_q_, restoring_, omega_;
  std::vector<double> re_, im_, middle_, gradient_, before_;
  std::vector<double> shift_, lift_;  // of a push: half its velocity; its amplitude, over omega_d
  std::vector<float> q_;
  double linear_j_ = 0.0;  // sum of (q'^2 + lambda q^2) / 2 after the sample
  double psi_ = 0.0, rest_j_ = 0.0, bound_j_ = 0.0, work_j_ = 0.0;
  bool has_before_ = false;
  CoupledCounters counters_;
};

}  // namespace carillon::nonlinear
