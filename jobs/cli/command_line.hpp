// Parser of the command line.
#pragma once

#include <functional>

#include "jobs/cli/shared.hpp"

namespace carillon::cli {

/// A parsed command; returns the exit code.
using Run = std::function<int()>;

/// Index of the command name, after the global options; argc if there is none.
int find_command(int argc, char** argv);

/// Parses global options into `shared`, which must outlive the result. For --help and --version prints the text and returns a function with
/// exit code 0. InputError for invalid arguments, with `shared.json` unchanged.
Run parse_command_line(int argc, char** argv, Shared& shared);

}  // namespace carillon::cli
