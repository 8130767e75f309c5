// Output name "-": data to standard output, messages to standard error.
#pragma once

#include <filesystem>
#include <string_view>

#include "runtime/base/error.hpp"

namespace carillon::base {

/// True for "-".
bool is_standard_output(const std::filesystem::path& file);

/// Throws InputError if standard output is a terminal. Called before long computations. `what` names the output ("mesh").
void check_standard_output(std::string_view what);

/// Writes and flushes. Throws SystemError.
void write_standard_output(std::string_view bytes);

}  // namespace carillon::base
