// What a bank is played with: corrected frequencies, or those of the mesh.
#pragma once

#include <cstdint>

#include "runtime/bank/bank.hpp"

namespace carillon::bank {

enum class Frequencies : std::uint8_t { kCorrected, kMesh };

/// The bank with its corrected frequencies and their decays in place of the mesh's, modes in their ascending order, without a proof, which
/// is about the mesh. Shapes and shares of the energy stay; reactions and radiation gains are those at the new frequencies. A bank that has
/// none is left as it is. Error bars are those of the corrected frequencies then. Not for an audio thread.
Bank calc_corrected(Bank bank);

/// calc_corrected(), or the bank as it is.
Bank choose_frequencies(Bank bank, Frequencies frequencies);

}  // namespace carillon::bank
