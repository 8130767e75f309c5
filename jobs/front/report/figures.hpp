// The data of a report as JSON, for page/report.js.
#pragma once

#include <filesystem>
#include <string>

#include "runtime/base/json.hpp"

namespace carillon::report {

/// {"file", "bytes", "version", "modes": {lists}, "proof", "surface", "checks" ...} of a bank, valid or not. InputError for a file that is
/// not a bank. `provenance`: set to the record in the bank.
base::Json make_figures(const std::filesystem::path& bank, std::string& provenance);

}  // namespace carillon::report
