// Audible modes of a mounted bank.
#pragma once

#include <vector>

#include "runtime/bank/bank.hpp"
#include "runtime/bank/heard.hpp"
#include "runtime/bank/mounting/losses.hpp"

namespace carillon::mounting {

/// Applies the supports to decays and frequencies of a bank prepared for playing (bank::choose_frequencies()); returns its audible modes.
/// Throws InputError as calc_losses() does.
std::vector<bank::HeardMode> mount(bank::Bank& played, const MountingRequest& request = {});

/// Result of mount() without changing the bank.
std::vector<bank::HeardMode> calc_heard_as_played(const bank::Bank& played);

/// Audible modes under default scene settings, by index in the file: corrected, in air if the bank has multipoles, on the bank's supports.
/// Modes coupled by the air: the mode in air of equal rank. Throws as mount() does.
std::vector<bank::HeardMode> calc_heard(const bank::Bank& bank);

}  // namespace carillon::mounting
