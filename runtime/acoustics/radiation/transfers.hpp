// Acoustic transfer of modes: pressure of their multipoles at a place.
#pragma once

#include <array>
#include <complex>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "runtime/acoustics/radiation/transfer_loops.hpp"
#include "runtime/bank/bank.hpp"
#include "runtime/base/instructions.hpp"

namespace carillon::radiation {

/// Smallest distance from the centre, in multipole radii; nearer places are moved out to it in their direction, because the series diverge
/// inside the sphere.
inline constexpr double kNearestRadii = 1.05;
/// Distance in radii from which get_turn_order() holds.
inline constexpr double kTurnRadii = 2.0;

/// Transfer T of each mode of a bank at a place x in the frame of the mesh, at the distance r from the centre of the multipoles: pressure
/// per unit modal velocity (q' = 1 m kg^1/2 / s), without the travel from the sphere of radius R,
///   T = p(x) e^{-i k (r - R)},   p as in runtime/bank/multipoles.hpp   [Pa s m^-1 kg^-1/2].
/// The sphere emits Re sum over modes of T z, z the complex modal velocities, which arrives (r - R) / c later. Sign convention e^{-i omega
/// t}, as the multipoles: T multiplies a z that rotates as e^{-i omega t}; for e^{+i omega t}, as in runtime/synth, use its complex
/// conjugate. A small body is mass loaded: pressure leads velocity, Im T < 0.
///
/// Accuracy: rounding of single precision and omitted orders are 80 dB below T, in the root mean square over directions, at every distance;
/// the multipoles have their own error (Multipoles::error_db, from nearest_m outward). Radial factors below 1e-30 count as 0. Instruction
/// sets differ in the last bits. Equations: docs/equations.md E10.
///
/// Invariant: owns copies of matching sizes; immutable, so any number of threads may evaluate.
class Transfers {
 public:
  /// Copies the multipoles. Throws InputError for a bank without multipoles and for arrays that disagree. Not for an audio thread. Uses the
  /// best instructions of the processor up to `best`.
  explicit Transfers(const bank::Bank& bank, base::Instructions best = base::Instructions::kBest);

  int get_mode_count() const noexcept { return static_cast<int>(orders_.size()); }
  const Vec3& get_centre_m() const noexcept { return centre_m_; }
  double get_radius_m() const noexcept { return radius_m_; }
  /// Order L of a mode: T varies over directions at most as fast as e^{i L angle}.
  int get_order(int mode) const noexcept { return orders_[mode]; }
  /// Power-weighted root mean square of the orders of a mode at kTurnRadii: the rate of variation from there on.
  double get_turn_order(int mode) const noexcept { return turn_orders_[mode]; }
  /// Root mean square over directions of the far field of a mode, scaled to 1 m [Pa at unit modal velocity]: the gain of GainKind::kBem,
  /// here from the multipoles instead of the decay.
  double get_rms(int mode) const noexcept { return rms_[mode]; }

  /// Memory [bytes].
  std::size_t calc_bytes() const noexcept;

  /// T of the given modes, 0 <= number < get_mode_count(), in any order (ascending costs least; 16 modes of similar order are evaluated
  /// together), into `transfer` of the same size. For audio threads: no heap, 170 kB of stack.
  void evaluate(const Vec3& place_m, std::span<const std::int32_t> modes, std::span<std::complex<float>> transfer) const noexcept {
    evaluate_at(std::span(&place_m, 1), modes, {transfer, {}});
  }
  /// Two places, at 2/3 of the cost per place.
  void evaluate(const std::array<Vec3, 2>& places_m, std::span<const std::int32_t> modes,
                const std::array<std::span<std::complex<float>>, 2>& transfers) const noexcept {
    evaluate_at(places_m, modes, transfers);
  }

 private:
  /// Appends a group of up to kTransferLanes modes, ascending in order; `first`: first coefficient of each mode.
  void add_group(const bank::Multipoles& air, std::span<const std::size_t> first, std::span<const std::size_t> modes);
  /// Factors of the recurrences of harmonics up to the order `highest`.
  void set_recurrences(int highest);

  void evaluate_at(std::span<const Vec3> places_m, std::span<const std::int32_t> modes,
                   const std::array<std::span<std::complex<float>>, 2>& transfers) const noexcept;

  /// Modes within a window of kWindow are sorted by order, then divided into groups.
  static constexpr int kWindow = 1024;

  Vec3 centre_m_{};
  double radius_m_ = 0.0;
  std::vector<int> orders_;          // (modes)
  std::vector<double> rms_;          // (modes)
  std::vector<double> turn_orders_;  // (modes)
  std::vector<std::int32_t> slots_;  // (modes) group times kTransferLanes plus lane; windows begin at multiples of kWindow
  std::vector<TransferGroup> groups_;
  std::vector<MultipoleLine> lines_;
  std::vector<RadialLine> radial_;
  std::vector<double> ahead_, behind_, diagonal_;  // of HarmonicWork
  const TransferLoops* loops_;
};

/// Transfers of a bank, shared by all that play it; nullptr without multipoles. Throws InputError for arrays that disagree.
std::shared_ptr<const Transfers> make_transfers(const bank::Bank& bank);

}  // namespace carillon::radiation
