// Parser of the command line.
#pragma once

#include <functional>
#include <string_view>

#include "jobs/cli/shared.hpp"

namespace carillon::cli {

/// A parsed command; returns the exit code.
using Run = std::function<int()>;

/// A command that another program of this installation carries out.
struct HandedOver {
  std::string_view command, program, help;
  bool keeps_command = false;  // the program takes the command as its first argument
};
inline constexpr HandedOver kHandedOver[] = {
    {"study", "carillon-study", "Studies: scaling JOB.json, advise BODY --cents 5; see carillon study --help"},
    {"match", "carillon-tune", "The material of a body from a recording: match JOB.json SOUND.wav; see carillon match --help", true},
    {"sensitivity", "carillon-tune", "Where to cut a body: sensitivity BANK; see carillon sensitivity --help", true},
    {"tune", "carillon-tune",
     "A body cut to wished frequencies: tune JOB.json --partials 1,4,10 --fundamental 185; see carillon tune --help", true}};

/// Index of the command name, after the global options; argc if there is none.
int find_command(int argc, char** argv);

/// Parses global options into `shared`, which must outlive the result. For --help and --version prints the text and returns a function with
/// exit code 0. InputError for invalid arguments, with `shared.json` unchanged.
Run parse_command_line(int argc, char** argv, Shared& shared);

}  // namespace carillon::cli
