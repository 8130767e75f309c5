// What a mode of a body sounds like at a place: the pressure of its multipoles there.
#pragma once

#include <array>
#include <complex>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "runtime/bank/bank.hpp"
#include "runtime/base/instructions.hpp"
#include "runtime/acoustics/radiation/transfer_loops.hpp"

namespace carillon::radiation {

/// Nearer to the centre than this, in radii of the multipoles, the place in the same direction at this distance counts: series diverge
/// inside the sphere.
inline constexpr double kNearestRadii = 1.05;
/// From here on, in radii, get_turn_order() holds.
inline constexpr double kTurnRadii = 2.0;

/// The transfer T of each mode of a bank at a place x in the frame of the mesh, at the distance r from the centre of the multipoles: the
/// pressure there per unit modal velocity (q' = 1 m kg^1/2 / s), without the travel from the sphere of radius R,
///   T = p(x) e^{-i k (r - R)},   p as in runtime/bank/multipoles.hpp   [Pa s m^-1 kg^-1/2].
/// Sound leaves the sphere as Re sum over modes of T z, with the modal velocities z as complex numbers, and is heard (r - R) / c later.
/// Signs: of e^{-i omega t}, as the multipoles have them: T multiplies a z that turns by e^{-i omega t}. Where z turns by e^{+i omega t},
/// as in runtime/synth, its complex conjugate does. A small body is mass to the air: pressure leads velocity, and Im T < 0.
///
/// Accuracy: what sums in single precision and omitted orders leave out, in the root mean square over directions at that distance, is 80 dB
/// below T, at every distance; the multipoles have their own error (Multipoles::error_db, stated from nearest_m outward). Radial factors
/// below 1e-30 count as 0. Instruction sets differ in the last bits. Equations: docs/equations.md E10.
///
/// Keeps true: holds copies only, and all its sizes agree; nothing changes after the constructor, so that any number of threads may
/// evaluate.
class Transfers {
 public:
  /// Copies the multipoles. Throws InputError where the bank has none, or where its arrays disagree. Not for an audio thread. Works with
  /// the best instructions that the processor has, and with no better ones than these.
  explicit Transfers(const bank::Bank& bank, base::Instructions best = base::Instructions::kAvx512);

  int get_mode_count() const noexcept { return static_cast<int>(orders_.size()); }
  const Vec3& get_centre_m() const noexcept { return centre_m_; }
  double get_radius_m() const noexcept { return radius_m_; }
  /// L of a mode: T changes over directions as fast as e^{i L angle} at most.
  int get_order(int mode) const noexcept { return orders_[mode]; }
  /// The same in the root mean square over the orders of a mode, by their power at kTurnRadii: from there on it changes no faster.
  double get_turn_order(int mode) const noexcept { return turn_orders_[mode]; }
  /// Of the far field of a mode, the root mean square over directions, taken back to 1 m [Pa at unit modal velocity]: what GainKind::kBem
  /// has from the decay, here from the multipoles.
  double get_rms(int mode) const noexcept { return rms_[mode]; }

  /// Memory.
  std::size_t calc_bytes() const noexcept;

  /// T of the modes of these numbers, 0 <= number < get_mode_count(), in any order (ascending numbers cost least; 16 modes of similar order
  /// are evaluated together), into `transfer` of the same size. For audio threads: no heap, 170 kB of stack.
  void evaluate(const Vec3& place_m, std::span<const std::int32_t> modes, std::span<std::complex<float>> transfer) const noexcept {
    evaluate_at(std::span(&place_m, 1), modes, {transfer, {}});
  }
  /// The same at two places, for two thirds of the price.
  void evaluate(const std::array<Vec3, 2>& places_m, std::span<const std::int32_t> modes,
                const std::array<std::span<std::complex<float>>, 2>& transfers) const noexcept {
    evaluate_at(places_m, modes, transfers);
  }

 private:
  void evaluate_at(std::span<const Vec3> places_m, std::span<const std::int32_t> modes,
                   const std::array<std::span<std::complex<float>>, 2>& transfers) const noexcept;

  /// A place of a mode: modes of a window of kWindow are sorted by order, then cut in groups.
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
  CalcHarmonics calc_harmonics_;
  CalcTransfers calc_transfers_;
};

/// Of a bank, to be shared by all that play it; nullptr where it has no multipoles. Throws InputError where its arrays disagree.
std::shared_ptr<const Transfers> make_transfers(const bank::Bank& bank);

}  // namespace carillon::radiation
