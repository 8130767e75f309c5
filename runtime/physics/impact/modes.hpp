// Modes of a body: exact propagators for a force that is constant within a step.
#pragma once

#include <map>
#include <memory>
#include <span>
#include <vector>

namespace carillon::impact {

/// Block size of loops over modes; arrays are padded to a multiple of it with zeros.
inline constexpr int kLanes = 8;

/// One step of length h, exact for  q'' + 2 d q' + w^2 q = f  with constant f:
///     q1 = a q + b v + g f,   v1 = c q + e v + b f,
/// for all regimes of damping and for w = 0. Arrays over modes, padded.
struct Propagator {
  std::vector<double> a, b, c, e, g;  // 1, s, 1/s, 1, s^2
};

/// Propagator of modes `omega` [rad/s], `decay` [1/s] (both >= 0, equal sizes) for a step `h_s`. Pure.
Propagator make_propagator(std::span<const double> omega, std::span<const double> decay, double h_s);

/// Step lengths of impacts are 2^(k/4) s, so that a few propagators serve all impacts of a body. get_step: the k-th; find_step: the largest
/// k with a step of at most `h_s`.
double get_step(int k);
int find_step(double h_s);

/// Modes above the band at a point of a plate-like body: a few strongly damped modes at fixed ratios above the band edge. For a constant
/// modal density the sum of phi^2/w^2 over all modes above w_c equals that over the last octave below it, the residual compliance c (plate
/// theory: c = 2/(pi Z w_c)). The range is divided into intervals [w_lo, w_hi] of ratio kTailRatio; each is one mode with the interval's
/// static compliance, c w_c (1/w_lo - 1/w_hi), and a decay of kTailDecay (w_hi - w_lo). Energy transferred to them is booked as "above the
/// band".
inline constexpr int kTailModes = 16;

/// Modes of one body, mass-normalised, with their propagators. Not thread-safe (propagators are created on first use); bodies of one bank
/// may share one object.
class Modes {
 public:
  /// omega [rad/s], decay [1/s], both >= 0 and of equal size (n). band_rad_s: edge of the band up to which `omega` is complete; 0: the
  /// largest omega. Throws std::invalid_argument for invalid sizes, signs or non-finite values.
  Modes(std::span<const double> omega, std::span<const double> decay, double band_rad_s = 0.0);

  int size() const { return static_cast<int>(omega_.size()); }
  const std::vector<double>& get_omega() const { return omega_; }
  double get_band() const { return band_; }
  const std::vector<double>& get_tail_omega() const { return tail_omega_; }  // empty if has_tail() is false

  /// Propagator for the step get_step(k); the last 24 are cached.
  std::shared_ptr<const Propagator> find_propagator(int k) const;
  /// Propagator of the modes above the band.
  std::shared_ptr<const Propagator> find_tail_propagator(int k) const;

  /// True if the body is plate-like at the edge of its band: at least 8 modes in the last octave, and at most 2.5 times as many as in the
  /// one before (plate 2, solid 8). For other bodies nothing is known above the band, and for a solid Hertz's law already includes it.
  bool has_tail() const { return has_tail_; }
  /// Residual compliance [m/N] at a point with shape values `phi` (n) along its normal [1/sqrt(kg)]; 0 if has_tail() is false.
  double calc_tail_compliance(std::span<const double> phi) const;
  /// Shape values of the kTailModes modes above the band that represent a residual compliance.
  std::vector<double> calc_tail_shapes(double compliance) const;

  /// Energy [J] of a modal state (n each): sum of (v^2 + w^2 q^2)/2.
  double calc_energy(std::span<const double> q, std::span<const double> q_dot) const;
  /// Advances a modal state by `time_s` >= 0 without a force, exactly.
  void move_freely(std::span<double> q, std::span<double> q_dot, double time_s) const;
  /// The same without damping, also backwards.
  void turn(std::span<double> q, std::span<double> q_dot, double time_s) const;

 private:
  std::vector<double> omega_, decay_, tail_omega_, tail_decay_;
  double band_ = 0.0;
  bool has_tail_ = false;
  mutable std::map<int, std::shared_ptr<const Propagator>> kept_, kept_tail_;
};

}  // namespace carillon::impact
