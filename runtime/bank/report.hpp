// Output of carillon-bank. Internal to the program.
#pragma once

#include <filesystem>
#include <span>
#include <string>

#include "runtime/bank/bank.hpp"
#include "runtime/bank/heard.hpp"

namespace carillon::bank {

/// Text page with at most `mode_limit` modes. `heard`: mounting::calc_heard(). `has_record`: with the record of its run.
std::string format_info(const Bank& bank, std::span<const HeardMode> heard, const std::filesystem::path& file, std::size_t mode_limit,
                        bool has_record);

/// Everything but mesh and shapes as JSON, numbers in full double precision.
std::string format_info_json(const Bank& bank, std::span<const HeardMode> heard, const std::filesystem::path& file);

/// CSV: header, then one line per mode; unknown values are empty.
std::string format_info_csv(const Bank& bank, std::span<const HeardMode> heard);

/// The two properties that need a JSON parser, which the library's checks do not use.
Check calc_regions_check(const Bank& bank);
Check calc_provenance_check(const Bank& bank);

/// One line per check.
std::string format_check(const Check& check);

}  // namespace carillon::bank
