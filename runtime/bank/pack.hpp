// A bank in few bytes, with an error that is stated.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "runtime/bank/bank.hpp"

namespace carillon::bank {

inline constexpr double kMinPackError = -90.0, kMaxPackError = -10.0;  // dB(A)

struct PackedBank {
  Bank bank;  // what a reader will find: shapes and places with their errors, vertices and triangles in the order of the file
  std::vector<std::uint8_t> surface, shape, order;  // as runtime/bank/packed reads them; order: empty unless triangles keep their numbers
};

/// Packs shapes and surface so that the error of a hard blow is at most `error_db` (Packing::error_db), and nearly that. Modes that are
/// heard more are kept more exactly, and so are places where a blow is heard less; walls of closed cavities may have 12 dB more. All
/// triangles stay, in another order unless they `keep_numbers`, to which contact events refer; vertices move by less than 1/30,000 of the
/// body's size, and those without a triangle are left out. Frequencies, decays, gains and all else stay as they are; provenance says what
/// was done. Throws InputError for an error out of range and for a bank without modes. The bank is sane. Takes seconds.
PackedBank calc_packed(const Bank& bank, double error_db, bool keep_numbers = false);

/// The error of a bank that was unpacked against the one that was packed, without witnesses. Throws InputError when that is another. Both
/// are sane.
Packing compare_packed(const Bank& packed, const Bank& original);

/// "error at most -60.2 dB(A) on 95 % of the surface, -57.1 at the worst place"
std::string describe(const Packing& packing);

/// "original": the error against the bank that was packed, by compare_packed(), and whether it is no greater than stated. The bank has a
/// Packing. Throws as compare_packed() does.
Check check_original(const Bank& packed, const Bank& original);

/// "packing": what the witnesses say of the stated error. The bank has a Packing, and its array sizes agree.
Check check_packing(const Bank& bank);

}  // namespace carillon::bank
