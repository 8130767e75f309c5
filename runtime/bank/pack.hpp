// Lossy compression of banks with a stated error.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "runtime/bank/bank.hpp"

namespace carillon::bank {

inline constexpr double kMinPackError = -90.0, kMaxPackError = -10.0;  // dB(A)
inline constexpr double kPackError = -60.0;                            // default

struct PackedBank {
  Bank bank;                                        // as decoded: quantised shapes and vertices, in file order
  std::vector<std::uint8_t> surface, shape, order;  // input of runtime/bank/packed; order: empty unless triangles keep their numbers
};

/// Packs shapes and surface so that the error of a hard blow is just below `error_db` (Packing::error_db). Audible modes and places with
/// quiet blows are kept more precisely; walls of closed cavities may have 12 dB more. All triangles stay, reordered unless `keep_numbers`
/// (contact events refer to triangle numbers); vertices move by less than 1/1,000,000 of the body's size, unused ones are removed.
/// Frequencies, decays, gains and the rest are unchanged; the provenance records the packing. Throws InputError for an error out of range
/// and for a bank without modes. The bank must be valid. Takes seconds.
PackedBank calc_packed(const Bank& bank, double error_db, bool keep_numbers = false);

/// False for banks whose shapes take less than a megabyte, which gain little.
inline bool is_worth_packing(const Bank& bank) { return bank.shape.size() * sizeof(std::int16_t) >= 1'000'000; }

/// Error of an unpacked bank against its original, without witnesses. Throws InputError if they do not match. Both must be valid.
Packing compare_packed(const Bank& packed, const Bank& original);

/// "error at most -60.2 dB(A) on 95 % of the surface, -57.1 at the worst place"
std::string describe(const Packing& packing);

/// Check "original": the error by compare_packed() does not exceed the stated one. The bank has a Packing. Throws as compare_packed() does.
Check check_original(const Bank& packed, const Bank& original);

/// Check "packing": witnesses against the stated error. The bank has a Packing, and its array sizes agree.
Check check_packing(const Bank& bank);

}  // namespace carillon::bank
