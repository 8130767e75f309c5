// "-" as the name of an output: the bytes go to standard output, and what a program says goes to standard error.
#pragma once

#include <filesystem>
#include <string_view>

#include "runtime/base/error.hpp"

namespace carillon::base {

/// Whether an output is named "-".
bool is_standard_output(const std::filesystem::path& file);

/// Throws InputError when standard output is a terminal, which shows no bytes. Meant for before long work. `what` names the output
/// ("mesh").
void check_standard_output(std::string_view what);

/// Writes all bytes and empties the buffer. Throws SystemError when the reader refuses.
void write_standard_output(std::string_view bytes);

}  // namespace carillon::base
