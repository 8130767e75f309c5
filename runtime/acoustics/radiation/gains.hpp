// How loud a mode is: from its shape on the outer surface to the pressure in the far field. Made once, when a bank is loaded.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "runtime/bank/bank.hpp"

namespace carillon::radiation {

enum class GainKind {
  kOsg02,   // the bank's own: one pulsating sphere, no cancellation (O'Brien, Shen, Gatchalian 2002)
  kSphere,  // spherical multipoles about the body's centre, with cancellation
  kVddp96,  // no air at all: every mode as loud as its coordinate q, 1 Pa for 1 m kg^1/2 (van den Doel, Pai 1996, a_n = Psi_n / omega_n)
  kBem,     // of the bank's multipoles, which boundary elements found (bank::calc_far_gains())
  kAuto     // kBem for a bank with multipoles, kSphere for others
};

/// Their names in files and options, in the order of GainKind.
inline const std::vector<std::string> kGainKindNames{"osg02", "sphere", "vddp96", "bem", "auto"};
/// The kind of that name; `option` begins the message. Throws InputError.
GainKind require_gain_kind(std::string_view option, std::string_view name);
/// What a bank is played with: the wish, or what kAuto stands for.
GainKind choose_gain_kind(const bank::Bank& bank, GainKind wish);

/// Multipoles that are resolved; what moves in finer patterns radiates as one of order kMaxLobes + 1.
inline constexpr int kMaxLobes = 8;

/// The pressure amplitude at 1 m [Pa] for unit modal velocity (q' = 1 m kg^1/2 / s) of every mode, (m); for kSphere the root mean square
/// over all directions of the far field, taken back to 1 m. kSphere is exact for a sphere that moves in patterns of order kMaxLobes and
/// below, to what the 16-bit shapes hold: nothing below 1e-6 of the pressure of a pulsating sphere of the same velocity is to be trusted.
/// The same mean for kBem, of the true shape. Throws InputError when arrays of the bank disagree, its surface has no outside, or kBem is
/// asked of a bank without multipoles. Not for an audio thread; any other, several at once.
std::vector<double> calc_gains(const bank::Bank& bank, GainKind kind);

/// Both of a bank at once, for the price of one: the gains as calc_gains() gives them, and calc_sphere_radius_m().
struct Radiation {
  std::vector<double> gains;
  double sphere_radius_m = 0.0;
};
Radiation calc_radiation(const bank::Bank& bank, GainKind kind);

/// What limit_gains() has done.
struct Limited {
  std::size_t modes = 0;  // whose gains came down
  double max_db = 0.0;    // by at most so much
};

/// Brings every gain (m) down to that with which its mode radiates all that its damping takes, g^2 = rho c d / 2 pi: a decay (m) [1/s]
/// counts as all there is, radiation included, so that what sounds is never more than what the mode had. A mode that nothing damps (0)
/// keeps its gain: it rings for ever, as it was asked to. Throws InputError where the sizes differ.
Limited limit_gains(std::span<double> gains, std::span<const double> decay_per_s);

/// What put_gains() has found and done.
struct PutGains {
  double sphere_radius_m = 0.0;
  Limited limited{};
};
/// Puts the gains of a kind into a bank that has the decays with which it is played (bank::choose_frequencies()); those of kSphere are
/// limited by them. Those of kBem are not: what they radiate is in the decays. The decays stay as they are for every kind: a bank with
/// multipoles that is played as a sphere fades as in its air. Throws InputError as calc_gains() does.
PutGains put_gains(bank::Bank& bank, GainKind kind);

/// Radius [m] of the sphere that has the volume inside the outer surface, cavities and all. InputError as above.
double calc_sphere_radius_m(const bank::Bank& bank);

}  // namespace carillon::radiation
