// What a bank is played with: corrected frequencies, or those of the mesh.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "runtime/bank/bank.hpp"

namespace carillon::bank {

enum class Frequencies : std::uint8_t { kCorrected, kMesh };

/// The bank with its corrected frequencies and their decays in place of the mesh's, modes in their ascending order, without a proof, which
/// is about the mesh. Shapes and shares of the energy stay, but for those of modes that the air couples (mix_modes()); reactions and
/// radiation gains are those at the new frequencies. Error bars are those of the corrected frequencies then. A bank with multipoles is
/// played in air, with corrected frequencies or without: frequencies are those of the modes in air, decays have radiation in them,
/// radiation gains are the root mean square over all directions, and the multipoles stay, with `is_in_decay` set: a second call changes
/// nothing. A bank that has neither is left as it is. Not for an audio thread.
Bank calc_corrected(Bank bank);

/// calc_corrected(), or the bank with the frequencies of the mesh: as it is, but for what radiation adds to decays, the radiation gains,
/// and the shapes of modes that the air couples, where it has multipoles.
Bank choose_frequencies(Bank bank, Frequencies frequencies);

/// Undamped playing frequency [Hz] of a mode of a bank as stored: in air, else corrected, else that of the mesh.
double find_played_hz(const Bank& bank, std::size_t mode);

/// Numbers of the modes in the order in which calc_corrected() leaves them.
std::vector<std::size_t> sort_played_modes(const Bank& bank);

}  // namespace carillon::bank
