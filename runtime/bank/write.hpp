// Bytes of bank files, for outputs other than files.
#pragma once

#include <filesystem>
#include <string>

#include "runtime/bank/bank.hpp"
#include "runtime/bank/pack.hpp"

namespace carillon::bank {

/// Output of write_bank(). Throws InputError for an invalid bank. Not thread-safe (HDF5).
std::string make_bank_bytes(const Bank& bank);

/// Writes a packed bank as write_bank() does.
void write_packed_bank(const PackedBank& packed, const std::filesystem::path& file);
std::string make_packed_bytes(const PackedBank& packed);

}  // namespace carillon::bank
