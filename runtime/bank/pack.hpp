// Lossy compression of banks with a stated error.
#pragma once

#include <cstdint>
#include <optional>
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

/// calc_packed() with kPackError and kept numbers for banks that gain by it; empty, with the reason in `why`: the shapes take less than 1
/// MB as 16-bit numbers, the bank has faults or is packed already, the error cannot be reached, or memory is short.
std::optional<PackedBank> try_packed(const Bank& bank, std::string& why);

/// Error of an unpacked bank against its original, without witnesses. Throws InputError if they do not match. Both must be valid.
Packing compare_packed(const Bank& packed, const Bank& original);

/// "error at most -60.2 dB(A) on 95 % of the surface, -57.1 at the worst place"
std::string describe(const Packing& packing);

/// Check "original": the error by compare_packed() does not exceed the stated one. The bank has a Packing. Throws as compare_packed() does.
Check check_original(const Bank& packed, const Bank& original);

/// Check "packing": witnesses against the stated error. The bank has a Packing, and its array sizes agree.
Check check_packing(const Bank& bank);

}  // namespace carillon::bank
