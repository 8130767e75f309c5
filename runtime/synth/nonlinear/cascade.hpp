// Approximate modes above the coupled ones in strong motion: they take energy from the coupled modes and pass it on by a law of wave
// turbulence, and follow the mean tension.
//
//   nonlinear::Cascade cascade(constants_of_coupled, constants_above, {.mass_kg = 0.24, .thickness_m = 5e-4}, 48000.0);
//   coupled.step(push_re, push_im);
//   cascade.step(coupled, push_re_above, push_im_above, {});
//   pressure += gain[i] * cascade.get_velocity(i);
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "runtime/synth/nonlinear/coupled_modes.hpp"

namespace carillon::nonlinear {

struct CascadeBody {
  double mass_kg = 0.0;
  double thickness_m = 0.0;
};

struct CascadeOptions {
  double constant = 0.3;          // kappa of docs/equations.md E12
  double strong = 0.3;            // sigma of docs/equations.md E12
  std::uint64_t seed = 20130915;  // of the phases of transferred energy
};

/// Energy balance since the start or the last reset() [J].
struct CascadeBook {
  double taken_j = 0.0;   // taken from the coupled modes
  double gained_j = 0.0;  // by these modes
  double lost_j = 0.0;    // lost to modes beyond the last one
};

/// M linear modes. State v = q' and y = sqrt(lambda) q, energy (v^2 + y^2) / 2, conserved by any rotation. Invariant: these modes gain
/// exactly the loss of the coupled modes, to rounding, and no mode gives more than it has. Without strong motion each is the linear mode.
/// Deterministic. Allocates in the constructor only; one thread at a time; only the constructor throws. docs/equations.md E12.
class Cascade {
 public:
  /// `above`: ascending. Throws InputError if empty, for a mode that does not oscillate below the Nyquist frequency, and if a number of the
  /// body or the constant is not finite and positive.
  Cascade(std::span<const ModeConstants> coupled, std::span<const ModeConstants> above, const CascadeBody& body, double rate_hz,
          const CascadeOptions& options = {});

  /// Advances to the sample of `coupled`. Pushes and `keep` as in CoupledModes::step(), (M) each; empty: none. [audio-thread]
  void step(CoupledModes& coupled, std::span<const double> push_re, std::span<const double> push_im, std::span<const double> keep) noexcept;

  int get_count() const noexcept { return count_; }
  double get_velocity(int i) const noexcept { return v_[i]; }
  std::span<const double> get_velocities() const noexcept { return std::span(v_).first(count_); }
  /// As CoupledModes.
  double get_re(int i) const noexcept { return v_[i] + tilt_[i] * get_im(i); }
  double get_im(int i) const noexcept { return y_[i] * damped_share_[i]; }
  void set_state(int i, double q, double velocity) noexcept;
  void reset() noexcept;

  bool is_moving() const noexcept { return is_moving_; }
  double calc_energy_j() const noexcept;
  const CascadeBook& get_book() const noexcept { return book_; }
  std::size_t calc_bytes() const noexcept;

  static constexpr int kFeedSamples = 8;  // between two exchanges of energy

 private:
  struct Band {
    std::size_t first = 0, last = 0;  // modes
    double freq_hz = 0.0;             // geometric mean
    double energy_j = 0.0, out_j = 0.0, in_j = 0.0;
    double calc_mean_j() const noexcept { return energy_j / static_cast<double>(last - first); }
  };
  void turn(double angle) noexcept;
  void exchange(CoupledModes& coupled) noexcept;
  double find_flux(double low_j, double high_j, double ratio_log) const noexcept;
  double feed(CoupledModes& coupled, const Band& band) noexcept;
  void settle(Band& band) noexcept;

  CascadeOptions options_;
  double period_s_ = 0.0, flux_per_j3_ = 0.0, strong_j_ = 0.0, largest_angle_ = 0.0;
  int count_ = 0, samples_ = 0;
  bool is_moving_ = false;
  std::uint64_t chance_ = 0;
  std::vector<double> vv_, vy_, yv_, yy_, tilt_, damped_share_, omega_;  // of the rotation over a sample; d / omega_d; omega_d / omega
  std::vector<double> v_, y_, noise_, share_, coupled_hz_;
  std::vector<Band> bands_;
  CascadeBook book_;
};

}  // namespace carillon::nonlinear
