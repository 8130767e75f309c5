// Frequencies for playing: corrected, or those of the mesh.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "runtime/bank/bank.hpp"

namespace carillon::bank {

enum class Frequencies : std::uint8_t { kCorrected, kMesh };

/// The bank with corrected frequencies and their decays, modes sorted, without the proof (which concerns the mesh). Shapes and energy
/// shares are kept, except for modes coupled by the air (mix_modes()); reactions and radiation gains follow the new frequencies; error bars
/// are those of the corrected frequencies. With multipoles, corrected or not: frequencies in air, decays including radiation, rms gains
/// over all directions; the multipoles stay, with `is_in_decay` set, so that the function is idempotent. A bank with neither is unchanged.
/// Not for audio threads.
Bank calc_corrected(Bank bank);

/// calc_corrected(), or the bank at the frequencies of the mesh; with multipoles, decays, gains and coupled shapes are those in air either
/// way.
Bank choose_frequencies(Bank bank, Frequencies frequencies);

/// Undamped playing frequency [Hz] of a mode of a bank as stored: in air, else corrected, else that of the mesh.
double find_played_hz(const Bank& bank, std::size_t mode);

/// Mode indices in the order of calc_corrected().
std::vector<std::size_t> sort_played_modes(const Bank& bank);

}  // namespace carillon::bank
