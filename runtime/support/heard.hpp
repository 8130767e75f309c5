// The modes of a bank as a scene that says nothing else makes them heard.
#pragma once

#include <vector>

#include "runtime/bank/bank.hpp"
#include "runtime/bank/heard.hpp"

namespace carillon::support {

/// By number in the file: corrected, in air where the bank has multipoles, on the supports that the bank names. Where the air couples modes
/// the mode is the one in air whose place the number has. Throws InputError as calc_losses() does.
std::vector<bank::HeardMode> calc_heard(const bank::Bank& bank);

}  // namespace carillon::support
