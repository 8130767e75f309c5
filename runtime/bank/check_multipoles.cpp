// Checks of a bank's multipoles.
// Method: the surface lies within the sphere; the radiation decay equals the far-field power recomputed from the coefficients, up to their
//   rounding. In a half space the field is that of the body and its mirror image and the body radiates half of the power, so all decays are
//   halved. Modes coupled by the air are sums with unit modal mass.
// Source: docs/equations.md E10.
// Deviations: the surface may exceed the sphere by the displacement of packed vertices (sqrt(3) / 2 of a lattice step, 5.3e-5 of the
// radius):
//   an unpacked bank does not record that it was packed.
#include <algorithm>
#include <cmath>

#include "runtime/bank/faults.hpp"
#include "runtime/bank/mixing.hpp"

namespace carillon::bank {
namespace {

constexpr double kSphereExcess = 1e-4;        // excess over the sphere, relative to its radius
constexpr double kMaxDetuning = 0.4;          // relative shift by the mass of the air
constexpr double kModalMassTolerance = 1e-6;  // modal mass of a mode in air
constexpr double kRootTolerance = 1e-9;       // root of a decay, round-off
constexpr double kMaxAir = 1e5;               // kg/m^3, m/s: beyond any gas

void check_sphere(const Bank& bank, Faults& faults) {
  const Multipoles& air = bank.multipoles;
  if (!(air.radius_m > 0.0 && air.radius_m <= kMaxLengthM)) return faults.add("radiation/radius_m is {:.6g} m, not a radius", air.radius_m);
  if (!(air.nearest_m >= air.radius_m && air.nearest_m <= kMaxLengthM))
    faults.add("radiation/nearest_m is {:.6g} m, not between the radius of {:.6g} m and {:.0e}", air.nearest_m, air.radius_m, kMaxLengthM);
  for (const auto& [name, value] : {std::pair("air_density_kg_m3", air.air_density_kg_m3), std::pair("sound_speed_ms", air.sound_speed_ms)})
    if (!(value > 0.0 && value <= kMaxAir)) faults.add("radiation/{} is {:.6g}, outside the range of gases", name, value);
  double farthest = 0.0;
  for (const auto& triangle : bank.triangles)
    for (const std::int32_t v : triangle)
      if (v >= 0 && static_cast<std::size_t>(v) < bank.vertex_count())  // others are reported elsewhere
        farthest = std::max(farthest, norm(bank.vertices_m[v] - air.centre_m));
  if (!(farthest <= air.radius_m * (1.0 + kSphereExcess)))
    faults.add("the surface reaches to {:.9g} m from radiation/centre_m, and the sphere has a radius of {:.9g} m", farthest, air.radius_m);
}

/// Frequency of the mode [Hz] without air, or in air if the bank is prepared for playing.
double find_hz(const Bank& bank, std::size_t mode) { return bank.corrected.is_empty() ? bank.freq_hz(mode) : bank.corrected.freq_hz[mode]; }

void check_mode(const Bank& bank, std::size_t i, Faults& faults) {
  const Multipoles& air = bank.multipoles;
  const double hz = find_hz(bank, i);
  if (!(air.freq_hz[i] > 0.0 && air.freq_hz[i] <= kMaxHz && std::abs(air.freq_hz[i] - hz) <= kMaxDetuning * hz))
    faults.add("radiation/freq_hz[{}] is {:.6g} Hz, and the mode has {:.6g} Hz: too far apart", i, air.freq_hz[i], hz);
  if (!(air.scale[i] >= 0.0)) faults.add("radiation/scale[{}] is {:.6g}, negative", i, air.scale[i]);
  if (!(air.decay_per_s[i] >= 0.0 && air.decay_per_s[i] <= kMaxDecayPerS))
    faults.add("radiation/decay[{}] is {:.6g} 1/s, not a decay", i, air.decay_per_s[i]);
  if (!(air.added_mass[i] > -1.0)) faults.add("radiation/added_mass[{}] is {:.6g}, not above -1", i, air.added_mass[i]);
  if (!(air.error_db[i] <= 0.0)) faults.add("radiation/error_db[{}] is {:.6g} dB, above the sound itself", i, air.error_db[i]);
}

/// Modes coupled by the air have unit modal mass including the air. Returns the largest number of parts of a mode.
std::int32_t check_mixing(const Multipoles& air, Faults& faults) {
  std::size_t at = 0;
  std::int32_t most = 0;
  for (std::size_t i = 0; i < air.mixing.count.size(); ++i) {
    double squares = 0.0;
    for (std::int32_t k = 0; k < air.mixing.count[i]; ++k, ++at) squares += air.mixing.part[at] * air.mixing.part[at];
    most = std::max(most, air.mixing.count[i]);
    const double mass = squares * (1.0 + air.added_mass[i]);
    if (!(std::abs(mass - 1.0) <= kModalMassTolerance))
      faults.add("the parts of mode {} (radiation/mixing_part) have a modal mass of {:.9g} in air instead of 1", i, mass);
  }
  return most;
}

/// Compares the decays with `share` times the far-field power; returns the largest relative difference.
double check_decays(const Multipoles& air, const std::vector<CoefficientDecay>& found, double share, Faults& faults) {
  double worst = 0.0;
  for (std::size_t i = 0; i < found.size(); ++i) {
    const double wanted = share * found[i].decay_per_s, root = std::sqrt(wanted), rounding = std::sqrt(share) * found[i].root_rounding;
    const double off = std::abs(std::sqrt(air.decay_per_s[i]) - root);
    if (!std::isfinite(root) || !(off <= rounding * (1.0 + kRootTolerance) + kRootTolerance * root))
      faults.add("radiation/decay[{}] is {:.9g} 1/s, the coefficients give {:.9g}", i, air.decay_per_s[i], wanted);
    if (wanted > 0.0) worst = std::max(worst, std::abs(air.decay_per_s[i] / wanted - 1.0));
  }
  return worst;
}

}  // namespace

std::string find_order_fault(const Multipoles& multipoles) {
  std::uint64_t wanted = 0;  // 64 bits: untrusted orders could overflow a 32-bit std::size_t
  for (std::size_t i = 0; i < multipoles.order.size(); ++i) {
    const std::int32_t order = multipoles.order[i];
    if (order < 0 || order > kMaxOrder) return fmt::format("radiation/order[{}] is {}, outside 0 to {}", i, order, kMaxOrder);
    wanted += 2 * count_coefficients(order);
  }
  if (multipoles.coefficient.size() == wanted) return {};
  return fmt::format("arrays disagree: radiation/coefficient holds {} values and {} are wanted", multipoles.coefficient.size(), wanted);
}

std::string find_mixing_fault(const Mixing& mixing) {
  const auto motions = static_cast<std::int64_t>(mixing.count.size() + kRigidMotions);
  std::size_t at = 0;
  for (std::size_t i = 0; i < mixing.count.size(); ++i) {
    const std::int32_t count = mixing.count[i];
    if (count < 1 || count > std::ssize(mixing.motion) - static_cast<std::ptrdiff_t>(at))
      return fmt::format("radiation/mixing_count[{}] is {}, and {} parts are left", i, count, mixing.motion.size() - at);
    for (std::int64_t k = 0, before = -1; k < count; ++k, before = mixing.motion[at++])
      if (mixing.motion[at] <= before || mixing.motion[at] >= motions)
        return fmt::format("radiation/mixing_motion[{}] is {}: not above the one before it, or no motion of the {} there are", at,
                           mixing.motion[at], motions);
  }
  if (at != mixing.motion.size())
    return fmt::format("arrays disagree: radiation/mixing_motion holds {} values and {} are wanted", mixing.motion.size(), at);
  return {};
}

Check check_multipoles(const Bank& bank) {
  const Multipoles& air = bank.multipoles;
  if (air.is_empty()) return {"multipoles", "none", {}};
  Faults faults;
  check_sphere(bank, faults);
  for (std::size_t i = 0; i < bank.mode_count(); ++i) check_mode(bank, i, faults);
  const std::int32_t parts = check_mixing(air, faults);
  if (!faults.empty()) return {"multipoles", "", faults.take()};
  const std::vector<CoefficientDecay> found = calc_coefficient_decays(air);
  Faults of_whole, of_half;
  const double whole_off = check_decays(air, found, 1.0, of_whole), half_off = check_decays(air, found, 0.5, of_half);
  const bool is_half = !of_whole.empty() && of_half.empty();
  const auto [low, high] = std::minmax_element(air.order.begin(), air.order.end());
  const std::string figure =
      fmt::format("multipoles of order {} to {}, which make the decays to {:.1e}{}{}", *low, *high, is_half ? half_off : whole_off,
                  is_half ? " (half a space)" : "", parts > 0 ? fmt::format("; modes coupled, of {} at most", parts) : "");
  return {"multipoles", figure, is_half ? std::vector<std::string>{} : of_whole.take()};
}

}  // namespace carillon::bank
