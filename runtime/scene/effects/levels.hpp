// Predicted loudness of a strike: modes, acceleration noise, and the loss by the pulse length.
#pragma once

#include <span>
#include <vector>

#include "runtime/bank/bank.hpp"
#include "runtime/bank/reduce.hpp"
#include "runtime/events/events.hpp"

namespace carillon::radiation {
class Transfers;
}

namespace carillon::effects {

inline constexpr double kReferencePa = 20e-6;
inline constexpr double kLowestHz = 20.0, kHighestHz = 20000.0;  // audible
using bank::calc_a_weight;
/// Integration time of the ear: short sounds are as loud as steady ones of the same exposure in this time.
using bank::kEarS;

/// |P(f)| / P(0) of a contact pulse at `cycles` = frequency x duration >= 0. kHertz: Gamma(7/4)^2 / (Gamma(7/4 + x) Gamma(7/4 - x)), the
/// transform of sin^1.5; kGaussian: the Gaussian of the same variance. To 1e-6 below x = 64, an upper bound above. No throw; any thread.
double calc_pulse_spectrum(events::PulseShape shape, double cycles) noexcept;

/// dB(A) re 20 uPa of an A-weighted exposure [Pa^2 s] within kEarS. Minus infinity for 0.
double calc_level_db(double exposure_pa2_s) noexcept;

/// Acceleration noise of one strike, at 1 m, A-weighted.
struct ClickLevels {
  double pa2_s = 0.0;             // exposure
  double pulse_loss_pa2_s = 0.0;  // exposure of the difference to an ideal impulse
  double mean_hz = 0.0;           // root mean square of the frequency, weighted with the exposure
};

/// Properties of a bank that determine the loudness of strikes. Immutable; shared by all bodies of the bank.
class BankLevels {
 public:
  /// Modes from kLowestHz to the lower of kHighestHz and half the rate. `bank`: with the gains that are played; must outlive this.
  /// `transfers`: of the bank's multipoles; nullptr: computed here, if any.
  BankLevels(const bank::Bank& bank, double rate_hz, double sphere_radius_m = 0.0, const radiation::Transfers* transfers = nullptr);

  struct Mode {
    int index = 0;  // in the bank
    double freq_hz = 0.0;
    double decay_per_s = 0.0;  // of the slower root
    double gain_pa = 0.0;      // absolute value
    double weight = 0.0;       // A-weighting
    double spread_db = 0.0;    // standard deviation of its level over directions by the bank's multipoles; 0 without
  };
  std::span<const Mode> get_modes() const { return modes_; }
  const bank::Bank& get_bank() const { return *bank_; }
  double get_radius_m() const { return radius_m_; }  // of the sphere of the outer volume
  /// Power-weighted mean of Mode::spread_db at equal velocities.
  double get_spread_db() const { return spread_db_; }

  /// |phi_m . direction| of every mode of get_modes() at a point of a triangle. False, without output, for a missing triangle.
  bool calc_projections(std::int32_t triangle, const Vec3& barycentric, const Vec3& direction, std::vector<double>& projections) const;

  /// A-weighted exposure at 1 m [Pa^2 s] of a push below the lowest mode, where modes follow the force without ringing: pressure = slope of
  /// the force times the sum of g (phi . J) / omega^2, from kLowestHz to 0.7 of the lowest mode. The only sound of modes above the audible
  /// range. 0 for a missing triangle.
  double calc_pushed_pa2_s(std::int32_t triangle, const Vec3& barycentric, const Vec3& impulse_n_s, events::PulseShape shape,
                           double duration_s) const;

  /// True with a mode from kLowestHz to half the rate.
  bool can_ring() const { return !pushed_.empty(); }

  /// Acceleration noise of an impulse [N s] at 1 m, in its loudest direction: a sphere of the outer volume and the mass
  /// (docs/decisions/acceleration-noise.md), from kLowestHz to the lower of kHighestHz and half the rate.
  ClickLevels calc_click_levels(double impulse_n_s, events::PulseShape shape, double duration_s) const;

 private:
  void find_spreads(const radiation::Transfers& transfers);

  const bank::Bank* bank_;
  double radius_m_ = 0.0, highest_hz_ = 0.0, spread_db_ = 0.0;
  std::vector<Mode> modes_;
  struct Band {
    double freq_hz, pa2_s;  // of a unit impulse of no length
  };
  std::vector<Band> click_;
  struct PushedMode {
    std::size_t index = 0;
    double gain_s2 = 0.0;  // gain over omega^2
  };
  std::vector<PushedMode> pushed_;
  std::vector<Band> push_;  // for a unit sum
};

/// Modal sound of one strike, at 1 m, A-weighted.
struct StrikeLevels {
  double modal_pa2_s = 0.0;       // exposure
  double pulse_loss_pa2_s = 0.0;  // exposure of the difference to an ideal impulse
  double mean_hz = 0.0;           // root mean square of the frequency, weighted with the exposure
};

/// `amplitude_pa` (modes): output, initial pressure amplitude of every mode at 1 m, not A-weighted.
StrikeLevels calc_strike_levels(const BankLevels& bank, std::span<const double> projections, events::PulseShape shape, double duration_s,
                                std::vector<double>& amplitude_pa);

}  // namespace carillon::effects
