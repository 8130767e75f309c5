// carillon: asks for banks, works through the queue, shows the state of jobs, and returns banks.
#include <fmt/core.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <exception>
#include <string>
#include <string_view>
#include <vector>

#include "jobs/cli/shared.hpp"
#include "runtime/base/document.hpp"
#include "runtime/base/error.hpp"
#include "runtime/version/version.hpp"

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

/// Where the name of the command stands, behind options of all commands; argc when there is none.
int find_command(int argc, char** argv) {
  for (int i = 1; i < argc; ++i) {
    const std::string_view word = argv[i];
    if (!word.starts_with('-')) return i;
    if (word == "--store" || word == "--profile")
      ++i;
    else if (word != "--json" && !word.starts_with("--store=") && !word.starts_with("--profile="))
      break;
  }
  return argc;
}

/// What follows "study" belongs to another program, its own --help too; of what stands before it, only --json does.
void hand_over_study(int argc, char** argv) {
  const int at = find_command(argc, argv);
  if (at == argc || std::string_view(argv[at]) != "study") return;
  std::vector<std::string> rest(argv + at + 1, argv + argc);
  if (std::any_of(argv + 1, argv + at, [](const char* word) { return std::string_view(word) == "--json"; })) rest.emplace_back("--json");
  become("carillon-study", rest);
}

/// Throws InputError for a word that is no command, with the nearest one.
void check_command(CLI::App& app, int argc, char** argv) {
  const int at = find_command(argc, argv);
  if (at == argc) return;
  std::vector<std::string> known;
  for (const CLI::App* command : app.get_subcommands([](CLI::App*) { return true; })) {
    if (command->get_name() == argv[at]) return;
    if (!command->get_group().empty()) known.push_back(command->get_name());
  }
  const std::string near = base::find_nearest(argv[at], known);
  throw InputError(fmt::format("\"{}\" is no command{}; carillon --help lists them", show(argv[at]),
                               near.empty() ? "" : ", did you mean \"" + near + "\"?"));
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
  app.add_flag("--json", shared.json, "One JSON document (of commands that keep running: one object a line)");
  app.set_version_flag("--version", version::describe("carillon"));
  for (const auto add : {add_submit, add_status, add_log, add_cancel, add_retry, add_explain, add_run, add_get, add_gc, add_verify,
                         add_validate, add_study, add_report})
    add(app, shared, command);
  add_attempt(app, command);
  const bool wants_json = std::any_of(argv, argv + argc, [](const char* word) { return std::string_view(word) == "--json"; });
  try {
    shared.json = wants_json;
    hand_over_study(argc, argv);
    check_command(app, argc, argv);
    app.parse(argc, argv);
    return command();
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return app.exit(error);
    return fail(wants_json, std::string(error.what()) + "; carillon --help, or --help after a command, lists the options", kExitInput);
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
