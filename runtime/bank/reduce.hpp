// Smaller banks: fewer modes, coarser shapes; ranking of modes by audibility.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "runtime/bank/bank.hpp"

namespace carillon::bank {

/// Time constant of the ear [s] (Zwislocki 1969).
inline constexpr double kEarS = 0.2;

/// A-weighting as an amplitude factor, 1 at 1 kHz (IEC 61672-1:2013, E.4.2). freq_hz >= 0.
double calc_a_weight(double freq_hz) noexcept;

/// A-weighted exposure at 1 m within kEarS after a hard blow (1 N s, 0.1 ms) where the mode moves by 1 kg^-1/2 along the normal, (m)
/// [Pa^2 s kg], by the bank's gains. The bank must be valid.
std::vector<double> calc_blow_exposure(const Bank& bank);

/// Audibility of each mode, (m) [Pa^2 s]: A-weighted exposure at 1 m within kEarS after a hard blow (1 N s, 0.1 ms) along the normal,
/// averaged over the surface, by the bank's gains. The bank must be valid.
std::vector<double> calc_audibility(const Bank& bank);

/// Selection of modes: most audible by calc_audibility(), or lowest corrected frequencies (as `max_modes` of a job).
enum class Keep : std::uint8_t { kLoudest, kLowest };

inline constexpr int kMinShapeBits = 2, kMaxShapeBits = 16;

struct Reduction {
  std::optional<std::size_t> modes{};  // at least 1; all if unset or above the number present
  Keep keep = Keep::kLoudest;
  int shape_bits = kMaxShapeBits;  // bits per shape component, sign included; up to 8: one byte in the file
};

/// The bank with the selected modes, in order, and shapes rounded to the nearest of 2^bits - 1 steps. A bank that lost modes is not
/// complete; the proof is kept for the lowest modes, for which it remains valid, and dropped otherwise. The provenance records the
/// reduction. Throws InputError for no modes and for bits out of range. Not for audio threads.
Bank calc_reduced(const Bank& bank, const Reduction& reduction);

}  // namespace carillon::bank
