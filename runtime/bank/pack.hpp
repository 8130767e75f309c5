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
  std::vector<std::uint8_t> surface, shape;  // as runtime/codec reads them
};

/// Packs shapes and surface so that the error of a hard blow is at most `error_db` (Packing::error_db), and nearly that. Modes that are
/// heard more are kept more exactly. All triangles stay; vertices move by less than 1/30,000 of the body's size, and those without a
/// triangle are left out. Frequencies, decays, gains and all else stay as they are. Throws InputError for an error out of range and for a
/// bank without modes. The bank is sane. Takes seconds.
PackedBank calc_packed(const Bank& bank, double error_db);

/// The error of shapes (V, m, 3) [steps of shape_scale] against those of `bank`: means over the outer surface, and the worst place [dB].
/// Packing without witnesses.
Packing calc_pack_error(const Bank& bank, const std::vector<std::int16_t>& shape);

/// The same of a bank that was unpacked against the one that was packed. Throws InputError when that is another. Both are sane.
Packing compare_packed(const Bank& packed, const Bank& original);

/// "error -60.2 dB(A) in the mean, -47.1 at the worst place"
std::string describe(const Packing& packing);

/// "packing": what the witnesses say of the stated error. The bank has a Packing, and its array sizes agree.
Check check_packing(const Bank& bank);

}  // namespace carillon::bank
