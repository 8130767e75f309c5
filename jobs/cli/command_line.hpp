// The words of the command line: which command they ask for, with which options.
#pragma once

#include <functional>

#include "jobs/cli/shared.hpp"

namespace carillon::cli {

/// What a command line asks for; gives the exit code.
using Run = std::function<int()>;

/// Where the name of the command stands, after the options that all commands share; argc when there is none.
int find_command(int argc, char** argv);

/// Reads the words: options of all commands into `shared`, which must outlive what is returned. For --help and --version it prints the text
/// and returns a function that does nothing and gives 0. Throws InputError for words that cannot be read, with `shared.json` as it was.
Run parse_command_line(int argc, char** argv, Shared& shared);

}  // namespace carillon::cli
