// carillon: asks for banks, works through the queue, tells where jobs stand, and hands out what is done.
#include <fmt/core.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <exception>
#include <string>
#include <string_view>

#include "jobs/cli/shared.hpp"
#include "runtime/config/error.hpp"

namespace carillon::cli {

void add_attempt(CLI::App& app, Run& run);

namespace {

constexpr const char* kAbout =
    "Jobs and their banks. A bank is kept under the hash of the job, the bytes of its mesh and the version of the solver: what was "
    "computed once is\n"
    "never computed again, from whatever folder it is asked for. Start with: carillon submit JOB.json --run";
constexpr const char* kFooter =
    "ID is an id or its beginning, or the job file. Exit codes: 0 done, 1 not done yet, 2 the input cannot be used, 3 a job failed, 4 the "
    "machine\n"
    "refused, 128 + n stopped by signal n. The store: --store, else \"store\" of the profile, else $XDG_DATA_HOME/carillon, else\n"
    "~/.local/share/carillon. The profile: --profile, else ~/.config/carillon/profile.json, {\"store\": DIR, \"on\": \"local\" or "
    "\"slurm\"}.";

int fail(bool json, const std::string& what, int code) {
  std::fflush(stdout);
  if (json) {
    Json::Value root;
    root["error"] = to_json(what);
    root["exit_code"] = code;
    print_json(root);
  }
  fmt::print(stderr, "carillon: {}\n", show_message(what));
  return code;
}

int run(int argc, char** argv) {
  CLI::App app(kAbout, "carillon");
  app.footer(kFooter);
  app.require_subcommand(1);
  app.fallthrough();
  Shared shared;
  Run command;
  app.add_option("--store", shared.store_option, "Folder of the store; made when there is none");
  app.add_option("--profile", shared.profile_option, "Profile file");
  app.add_flag("--json", shared.json, "One JSON document (of commands that go on: one object a line)");
  app.set_version_flag("--version", fmt::format("carillon {}", CARILLON_VERSION));
  for (const auto add :
       {add_submit, add_status, add_log, add_cancel, add_retry, add_explain, add_run, add_get, add_gc, add_validate, add_study, add_report})
    add(app, shared, command);
  add_attempt(app, command);
  // What follows "study" belongs to another program.
  const bool wants_json = std::any_of(argv, argv + argc, [](const char* word) { return std::string_view(word) == "--json"; });
  try {
    if (argc > 1 && std::string_view(argv[1]) == "study")
      become(find_program("carillon-study"), {argv + 2, argv + argc});  // its own --help
    app.parse(argc, argv);
    return command();
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return app.exit(error);
    return fail(wants_json, std::string(error.what()) + "; carillon --help, or --help after a command, tells what there is", kExitInput);
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
  try {
    return carillon::cli::run(argc, argv);
  } catch (const std::exception& error) {
    fmt::print(stderr, "carillon: {}\n", error.what());
    return carillon::kExitSystem;
  }
}
