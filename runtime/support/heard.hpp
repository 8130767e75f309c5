// The modes of a bank as heard in a scene of default settings.
#pragma once

#include <vector>

#include "runtime/bank/bank.hpp"
#include "runtime/bank/heard.hpp"

namespace carillon::support {

/// By number in the file: corrected, in air for a bank with multipoles, on the bank's supports. Modes coupled by the air: the mode in air
/// at the same rank. Throws InputError as calc_losses() does.
std::vector<bank::HeardMode> calc_heard(const bank::Bank& bank);

}  // namespace carillon::support
