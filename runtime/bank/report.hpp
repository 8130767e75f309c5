// What carillon-bank prints. Internal to the program.
#pragma once

#include <filesystem>
#include <span>
#include <string>

#include "runtime/bank/bank.hpp"
#include "runtime/bank/heard.hpp"

namespace carillon::bank {

/// A page for people; at most `mode_limit` rows of modes. `heard`: mounting::calc_heard(). `has_record`: with the record of its run.
std::string format_info(const Bank& bank, std::span<const HeardMode> heard, const std::filesystem::path& file, std::size_t mode_limit,
                        bool has_record);

/// All of a bank but its mesh and shapes as JSON, numbers to full double precision.
std::string format_info_json(const Bank& bank, std::span<const HeardMode> heard, const std::filesystem::path& file);

/// CSV: a line of names, then one line per mode; unknown values are empty.
std::string format_info_csv(const Bank& bank, std::span<const HeardMode> heard);

/// The two properties that the library, which cannot read JSON, does not check.
Check calc_regions_check(const Bank& bank);
Check calc_provenance_check(const Bank& bank);

/// One line per check.
std::string format_check(const Check& check);

}  // namespace carillon::bank
