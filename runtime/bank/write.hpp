// The bytes of a bank file, for outputs that are no files.
#pragma once

#include <string>

#include "runtime/bank/bank.hpp"

namespace carillon::bank {

/// What write_bank() writes. Throws InputError as it does for a bank that is not sane. On one thread at a time (it uses HDF5).
std::string make_bank_bytes(const Bank& bank);

}  // namespace carillon::bank
