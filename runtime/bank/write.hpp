// The bytes of a bank file, for outputs that are no files.
#pragma once

#include <filesystem>
#include <string>

#include "runtime/bank/bank.hpp"
#include "runtime/bank/pack.hpp"

namespace carillon::bank {

/// What write_bank() writes. Throws InputError as it does for a bank that is not sane. On one thread at a time (it uses HDF5).
std::string make_bank_bytes(const Bank& bank);

/// The same for a packed bank; written as write_bank() writes.
void write_packed_bank(const PackedBank& packed, const std::filesystem::path& file);
std::string make_packed_bytes(const PackedBank& packed);

}  // namespace carillon::bank
