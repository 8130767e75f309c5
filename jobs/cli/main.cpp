// carillon: the command line program of the job service.
#include <fmt/core.h>

#include <algorithm>
#include <cstdio>
#include <exception>
#include <new>
#include <string>
#include <string_view>
#include <vector>

#include "jobs/cli/command_line.hpp"
#include "jobs/cli/shared.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/file_limit.hpp"
#include "runtime/base/message.hpp"

namespace carillon::cli {
namespace {

int fail(bool json, const std::string& what, int code) {
  std::fflush(stdout);
  if (json) {
    base::Json root;
    root.set("error", to_json(base::shorten(what))).set("exit_code", code);
    print_json(root);
  }
  fmt::print(stderr, "carillon: {}\n", show_message(what));
  return code;
}

/// Passes the arguments after a command of another program, including --help, to it; of those before, only --json.
void hand_over(int argc, char** argv) {
  const int at = find_command(argc, argv);
  if (at == argc) return;
  for (const HandedOver& one : kHandedOver) {
    if (argv[at] != one.command) continue;
    std::vector<std::string> rest(argv + at + (one.keeps_command ? 0 : 1), argv + argc);
    if (std::any_of(argv + 1, argv + at, [](const char* word) { return std::string_view(word) == "--json"; })) rest.emplace_back("--json");
    become(std::string(one.program), rest);
  }
}

int run(int argc, char** argv) {
  Shared shared;
  shared.json = std::any_of(argv, argv + argc, [](const char* word) { return std::string_view(word) == "--json"; });
  try {
    hand_over(argc, argv);
    return parse_command_line(argc, argv, shared)();
  } catch (const InputError& error) {
    return fail(shared.json, error.what(), kExitInput);
  } catch (const SolveError& error) {
    return fail(shared.json, error.what(), kExitSolve);
  } catch (const std::bad_alloc&) {
    return fail(shared.json, "out of memory; close other programs", kExitSystem);
  } catch (const std::exception& error) {
    return fail(shared.json, error.what(), kExitSystem);
  }
}

}  // namespace
}  // namespace carillon::cli

int main(int argc, char** argv) {
  carillon::base::report_file_limit();
  try {
    return carillon::cli::run(argc, argv);
  } catch (const std::exception& error) {
    fmt::print(stderr, "carillon: {}\n", error.what());
    return carillon::kExitSystem;
  }
}
