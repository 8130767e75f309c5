// Radiation gains: from the shape of a mode on the outer surface to its far-field pressure. Computed once, when a bank is loaded.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "runtime/bank/bank.hpp"

namespace carillon::radiation {

enum class GainKind {
  kOsg02,   // gains of the bank: a pulsating sphere, no cancellation (O'Brien, Shen, Gatchalian 2002)
  kSphere,  // spherical multipoles about the body's centre, with cancellation
  kVddp96,  // no radiation model: pressure = coordinate q, 1 Pa for 1 m kg^1/2 (van den Doel, Pai 1996, a_n = Psi_n / omega_n)
  kBem,     // from the bank's multipoles by boundary elements (bank::calc_far_gains())
  kAuto     // kBem for a bank with multipoles, kSphere for others
};

/// Names in files and options, in the order of GainKind.
inline const std::vector<std::string> kGainKindNames{"osg02", "sphere", "vddp96", "bem", "auto"};
/// GainKind by name; `option` begins the message. Throws InputError.
GainKind require_gain_kind(std::string_view option, std::string_view name);
/// Resolves kAuto for a bank.
GainKind choose_gain_kind(const bank::Bank& bank, GainKind wish);

/// Highest resolved multipole order; finer patterns radiate as order kMaxLobes + 1.
inline constexpr int kMaxLobes = 8;

/// Pressure amplitude at 1 m [Pa] of every mode at unit modal velocity (q' = 1 m kg^1/2 / s), (m); for kSphere the root mean square over
/// all directions of the far field, scaled to 1 m. kSphere is exact for a sphere that moves in patterns up to order kMaxLobes, within the
/// 16-bit resolution of the shapes: values below 1e-6 of the pressure of a pulsating sphere of the same velocity are unreliable. kBem: the
/// same mean for the true shape. Throws InputError if arrays of the bank disagree, its surface has no outside, or for kBem without
/// multipoles. Not for an audio thread; any other, several at once.
std::vector<double> calc_gains(const bank::Bank& bank, GainKind kind);

/// calc_gains() and calc_sphere_radius_m() at the cost of one.
struct Radiation {
  std::vector<double> gains;
  double sphere_radius_m = 0.0;
};
Radiation calc_radiation(const bank::Bank& bank, GainKind kind);

/// Result of limit_gains().
struct Limited {
  std::size_t modes = 0;  // with reduced gains
  double max_db = 0.0;    // largest reduction
};

/// Limits every gain (m) so that its mode radiates no more than its damping dissipates, g^2 = rho c d / 2 pi: the decay (m) [1/s] counts as
/// the total loss, radiation included, so the radiated energy never exceeds the modal energy. Undamped modes (0) keep their gain. Throws
/// InputError if the sizes differ.
Limited limit_gains(std::span<double> gains, std::span<const double> decay_per_s);

/// Result of put_gains().
struct PutGains {
  double sphere_radius_m = 0.0;
  Limited limited{};
};
/// Writes the gains of a kind into a bank with playback decays (bank::choose_frequencies()); kSphere gains are limited by them, kBem gains
/// are not, because the decays include their radiation. Decays are unchanged for every kind: a bank with multipoles played as a sphere
/// decays as in its air. Throws InputError as calc_gains().
PutGains put_gains(bank::Bank& bank, GainKind kind);

/// Radius [m] of the sphere with the volume inside the outer surface, cavities included. Throws InputError as calc_gains().
double calc_sphere_radius_m(const bank::Bank& bank);

}  // namespace carillon::radiation
