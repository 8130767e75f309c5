// Modes coupled by large motion: they stiffen and exchange energy.
//
//   nonlinear::CoupledModes modes(bank.quartic, constants, 48000.0);
//   modes.step(push_re, push_im);  // to the next sample, with the response to forces in between
//   pressure += gain[i] * modes.get_velocity(i);
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "runtime/bank/quartic_energy.hpp"
#include "runtime/synth/nonlinear/evaluator.hpp"
#include "runtime/synth/nonlinear/mode_constants.hpp"

namespace carillon::nonlinear {

/// Time-stepping scheme.
enum class Integrator {
  kGuarded,    // Verlet while its energy stays within the work of forces; else kAuxiliary
  kAuxiliary,  // scalar auxiliary variable: energy exact to rounding, pitch of strong motion less exact
  kVerlet,     // for comparisons: may be unstable
};

struct CoupledOptions {
  Integrator integrator = Integrator::kGuarded;
  double relaxation_s = 0.01;  // relaxation time of the auxiliary variable to the root of its energy; 0: never
  double tolerance = 0.02;     // relative excess of Verlet's energy over the work of forces
};

struct CoupledCounters {
  std::int64_t steps = 0;
  std::int64_t guarded = 0;  // of them, steps taken by the guard
  std::int64_t linear = 0;   // steps without nonlinear force, because single precision could not represent the energy
};

/// Coupled modes of a bank. State of a mode as in synth::ResonatorBank: re = q' + d q, im = omega_d q, omega_d^2 = lambda - d^2, which
/// rotates and decays exactly: for small motion it is the linear mode. Invariant: the energy
///   H = sum of (q'^2 + lambda q^2) / 2 + V(q)
/// is at most (1 + tolerance) times the work of pushes minus the losses to damping, for any energy and strikes. docs/equations.md E12.
/// Allocates in the constructor only; one thread at a time; only the constructor throws. Denormal numbers are slow: flush them to zero.
class CoupledModes {
 public:
  /// `modes`: per coupled mode, in the order of the energy. Throws InputError if sizes disagree, a mode does not oscillate (decay at or
  /// above sqrt(lambda)) or is at or above the Nyquist frequency, or a number is not finite.
  CoupledModes(const bank::QuarticEnergy& energy, std::span<const ModeConstants> modes, double rate_hz, const CoupledOptions& options = {});

  /// Advances by one sample without forces. [audio-thread]
  void step() noexcept { advance(nullptr, nullptr, nullptr); }
  /// With forces: the response at this sample of each mode at rest, uncoupled. (N) each. [audio-thread]
  void step(std::span<const double> push_re, std::span<const double> push_im) noexcept { advance(push_re.data(), push_im.data(), nullptr); }
  /// With damping contacts: before the push, the state of each mode is multiplied by `keep`, 0 to 1. [audio-thread]
  void step(std::span<const double> push_re, std::span<const double> push_im, std::span<const double> keep) noexcept {
    advance(push_re.data(), push_im.data(), keep.data());
  }

  int get_count() const noexcept { return count_; }
  /// State of mode i at the sample: re and im, in the middle of the nonlinear kick.
  double get_re(int i) const noexcept { return middle_[i]; }
  double get_im(int i) const noexcept { return im_[i]; }
  double get_velocity(int i) const noexcept {
    const std::size_t m = i;
    return middle_[m] - tilt_[m] * im_[m];
  }
  /// q [m kg^1/2].
  double get_amplitude(int i) const noexcept { return im_[i] / omega_[i]; }

  /// Sets amplitude and velocity of a mode; its energy counts as work. Not between samples of a strike. [audio-thread]
  void set_state(int i, double q, double velocity) noexcept;
  /// Removes a share of each velocity, 0 to 1; returns the removed energy [J], which leaves the balance. (N). Between two samples.
  /// [audio-thread]
  double take_velocity(std::span<const double> share) noexcept;
  /// (lambda q^2 + q'^2) / 2 of mode i [J], half a sample after the sample.
  double calc_mode_energy_j(int i) const noexcept;
  /// Equivalent mean tension tau [rad/s] of the present nonlinear force: a tension adds tau omega_i to lambda_i, as in a bending plate,
  /// where omega_i grows as the square of the wave number. q . grad V over the sum of omega_i q_i^2; negative for softening curved bodies.
  /// [audio-thread]
  double calc_tension_rad_s() const noexcept;
  /// Couples only the first `modes` from now on; the others continue as linear modes. [audio-thread]
  void set_limit(int modes) noexcept;
  int get_limit() const noexcept { return limit_; }
  /// Clears motion, energy and memory. [audio-thread]
  void reset() noexcept;

  /// H [J], half a sample after the sample.
  double get_energy_j() const noexcept { return linear_j_ + 0.5 * psi_ * psi_ - rest_j_; }
  /// Work of pushes minus losses to damping [J].
  double get_bound_j() const noexcept { return bound_j_; }
  /// Work of pushes since the start or the last reset() [J].
  double get_work_j() const noexcept { return work_j_; }
  bool is_moving() const noexcept { return linear_j_ > 0.0; }
  const CoupledCounters& get_counters() const noexcept { return counters_; }
  std::size_t calc_bytes() const noexcept;

 private:
  struct Step;  // sums at a sample before the kick
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
  std::vector<double> shift_, lift_;  // of a push: half its velocity; its amplitude over omega_d
  std::vector<float> q_;
  double linear_j_ = 0.0;  // sum of (q'^2 + lambda q^2) / 2 after the sample
  double psi_ = 0.0, rest_j_ = 0.0, bound_j_ = 0.0, work_j_ = 0.0;
  bool has_before_ = false;
  CoupledCounters counters_;
};

}  // namespace carillon::nonlinear
