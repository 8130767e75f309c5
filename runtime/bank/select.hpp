// Selection of modes.
#pragma once

#include <cstddef>
#include <vector>

#include "runtime/bank/bank.hpp"

namespace carillon::bank {

/// Mode indices by ascending corrected frequency (the mesh's if there is none); stable.
std::vector<std::size_t> sort_modes(const Bank& bank);

/// Keeps the modes `chosen`, in that order, in all per-mode arrays. The proof is unchanged.
void select_modes(Bank& bank, const std::vector<std::size_t>& chosen);

/// True if a mode of `freq_hz` belongs to a band that ends at `end_hz`: to 1e-9 of the eigenvalue, as in the eigensolver.
inline bool is_below_end(double freq_hz, double end_hz) { return freq_hz <= end_hz * (1 + 0.5e-9); }
/// The same of a band that begins at `begin_hz`.
inline bool is_above_begin(double freq_hz, double begin_hz) { return freq_hz >= begin_hz * (1 - 0.5e-9); }

/// Keeps the modes whose corrected frequency is in the band, in the mesh's order. Those below it are named in the proof. If none but the
/// highest of the mesh are above, the proof ends between the last and the first removed one, where the count follows from the one above and
/// the modes between.
void keep_band(Bank& bank);

/// Keeps the `count` modes of lowest corrected frequency, in the mesh's order. The proof is truncated below the first removed mode. No
/// effect if there are no more.
void keep_lowest(Bank& bank, std::size_t count);

}  // namespace carillon::bank
