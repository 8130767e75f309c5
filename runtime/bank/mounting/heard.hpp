// The modes of a bank as heard.
#pragma once

#include <vector>

#include "runtime/bank/bank.hpp"
#include "runtime/bank/heard.hpp"
#include "runtime/bank/mounting/losses.hpp"

namespace carillon::mounting {

/// Puts the supports into decays and frequencies of a bank for playing (bank::choose_frequencies()), and returns its modes as heard. Throws
/// InputError as calc_losses() does.
std::vector<bank::HeardMode> mount(bank::Bank& played, const MountingRequest& request = {});

/// Result of mount(); the bank is not changed.
std::vector<bank::HeardMode> calc_heard_as_played(const bank::Bank& played);

/// In a scene of default settings, by number in the file: corrected, in air for a bank with multipoles, on the bank's supports. Modes
/// coupled by the air: the mode in air at the same rank. Throws as mount() does.
std::vector<bank::HeardMode> calc_heard(const bank::Bank& bank);

}  // namespace carillon::mounting
