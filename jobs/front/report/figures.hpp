// The data of a report as JSON, for page/report.js.
#pragma once

#include <json/json.h>

#include <filesystem>
#include <string>

namespace carillon::report {

/// {"file", "bytes", "version", "modes": {lists}, "proof", "surface", "checks" ...} of a bank, valid or not. InputError for a file that is
/// not a bank. `provenance`: set to the record in the bank.
Json::Value make_figures(const std::filesystem::path& bank, std::string& provenance);

}  // namespace carillon::report
