// Some modes of a bank, in any order.
#pragma once

#include <cstddef>
#include <vector>

#include "runtime/bank/bank.hpp"

namespace carillon::bank {

/// Numbers of the modes by ascending corrected frequency; by the mesh's where the bank has no corrected ones. Equal ones keep their order.
std::vector<std::size_t> sort_modes(const Bank& bank);

/// Leaves the bank the modes `chosen`, in that order: every array that has an entry a mode follows. The proof is left as it is.
void select_modes(Bank& bank, const std::vector<std::size_t>& chosen);

/// Leaves the bank the `count` modes of the lowest corrected frequencies, in the order of the mesh's. The proof stays true: what it says is
/// complete ends below the first mode that went. Nothing happens where there are no more.
void keep_lowest(Bank& bank, std::size_t count);

}  // namespace carillon::bank
