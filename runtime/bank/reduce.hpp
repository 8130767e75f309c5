// A smaller bank of the same body: fewer modes, coarser shapes. And which modes are worth keeping.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "runtime/bank/bank.hpp"

namespace carillon::bank {

/// The ear's own time [s]: what has sounded longer ago counts no more (Zwislocki 1969).
inline constexpr double kEarS = 0.2;

/// A-weighting as a factor of the amplitude, 1 at 1 kHz (IEC 61672-1:2013, E.4.2). 0 <= freq_hz.
double calc_a_weight(double freq_hz) noexcept;

/// What a hard blow (1 N s, 0.1 ms) at a place where the mode moves by 1 kg^-1/2 along the normal gives of it, (m) [Pa^2 s kg]: the
/// A-weighted exposure at 1 m, within the ear's own time, by the bank's own gains. The bank is sane.
std::vector<double> calc_blow_exposure(const Bank& bank);

/// How much of each mode is heard, (m) [Pa^2 s]: the A-weighted exposure at 1 m, within the ear's own time, of a hard blow (1 N s, 0.1 ms)
/// along the normal, averaged over all places of the surface. By the bank's own gains. The bank is sane.
std::vector<double> calc_audibility(const Bank& bank);

/// Modes that a reduced bank keeps: the most audible ones by calc_audibility(), or those of the lowest corrected frequencies, as
/// `max_modes` of a job does.
enum class Keep : std::uint8_t { kLoudest, kLowest };

inline constexpr int kMinShapeBits = 2, kMaxShapeBits = 16;

struct Reduction {
  std::optional<std::size_t> modes{};  // at least 1; all where it is nothing or more than there are
  Keep keep = Keep::kLoudest;
  int shape_bits = kMaxShapeBits;  // of a component of a shape, its sign included; up to 8 the file has one byte for it instead of two
};

/// The bank with the modes that are kept, in their order, and shapes rounded to the nearest of 2^bits - 1 steps. A mode that is kept is as
/// it was but for that. A bank that lost modes is no longer complete; the proof stays with the lowest modes, for which it still holds, and
/// is dropped with any others. The provenance says what was done. Throws InputError for no modes and for bits out of range. Not for an
/// audio thread.
Bank calc_reduced(const Bank& bank, const Reduction& reduction);

}  // namespace carillon::bank
