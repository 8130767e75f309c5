#include "precompute/run/program.hpp"

#include <fmt/core.h>
#include <mpi.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "precompute/job/job_spec.hpp"
#include "precompute/petsc/session.hpp"
#include "precompute/run/end_in_error.hpp"
#include "precompute/run/interrupt.hpp"
#include "precompute/run/known_body.hpp"
#include "precompute/run/run_log.hpp"
#include "precompute/run/same_start.hpp"
#include "precompute/run/stages.hpp"
#include "precompute/run/validate.hpp"
#include "runtime/base/environment.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/file_limit.hpp"
#include "runtime/base/keys.hpp"
#include "runtime/base/message.hpp"
#include "runtime/base/printable.hpp"
#include "runtime/base/result.hpp"
#include "runtime/base/sha256.hpp"
#include "runtime/base/version.hpp"

namespace carillon::run {
namespace {

void print_start(const petsc::Session& session, bool quiet) {
  if (session.rank() != 0) return;
  if (!quiet) fmt::print("carillon-precompute {} on {} rank{}\n", base::get_number(), session.size(), session.size() == 1 ? "" : "s");
  std::fflush(stdout);
  if (petsc::blas_is_reference())
    fmt::print(stderr,
               "carillon-precompute: warning: this is the reference BLAS, about 14 times slower than OpenBLAS; "
               "apt-get install libopenblas0-serial\n");
  if (const std::string slow = petsc::describe_slow_kernels(); !slow.empty())
    fmt::print(stderr, "carillon-precompute: warning: {} (BLAS: {})\n", slow, petsc::blas_name());
}

/// The parsed command line.
struct CommandLine {
  CLI::App app{
      "Computes the vibration modes of a solid body and writes them as a mode bank.\n"
      "Start it on several ranks with: mpirun -np N carillon-precompute JOB.json\n"
      "Options of PETSc follow after --: carillon-precompute JOB.json -- -log_view",
      "carillon-precompute"};
  std::string job;
  std::string result;    // file; empty: none
  std::string estimate;  // problem size; empty: none
  run::RunOptions options;
  std::optional<CLI::ParseError> error;

  CommandLine(int argc, char** argv) {
    const CLI::Validator named([](const std::string& file) { return file.empty() ? "the name of the file is empty" : ""; }, "FILE");
    app.failure_message(
        [](const CLI::App* asked, const CLI::Error& error) { return base::printable_lines(CLI::FailureMessage::simple(asked, error)); });
    app.add_option("JOB", job, "job file (JSON with // comments)");
    app.add_flag("-q,--quiet", options.quiet, "no output except warnings and errors on standard error");
    app.add_option("--progress", options.progress, "append the progress of the run to this file, one JSON object per line")->check(named);
    app.add_option("--checkpoint", options.checkpoint,
                   "resume from this file if it exists, and save to it; SIGUSR1 and SIGTERM save and exit with 85")
        ->check(named);
    app.add_option("--checkpoint-every", options.checkpoint_every_s, "seconds between two saves")
        ->check(CLI::Range(0.0, 1e9))
        ->capture_default_str();
    app.add_option("--bank", options.bank, "write the bank to this file instead of the job's \"bank\"")->check(named);
    app.add_option("--result", result, "write the outcome of the run to this file, a JSON object (docs/howto/jobs.md)")->check(named);
    CLI::Option* matrices =
        app.add_option("--matrices", options.matrices, "also write K and M to this folder, as Matrix Market files")->check(named);
    CLI::Option* validate =
        app.add_flag("--validate", options.validate, "check the job and its mesh, and predict modes and memory, without solving")
            ->excludes(matrices);
    app.add_option("--at", options.at_m, "print the modes of a string, beam, membrane, plate or table at a point; writes no bank")
        ->delimiter(',')
        ->type_name("X,Y,Z")
        ->excludes(validate);
    app.add_flag("--json", options.json, "with --validate: print one JSON object")->needs(validate);
    app.add_option("--memory-gb", options.memory_gb, "refuse a solve that needs more memory for all ranks of a machine together [GB]")
        ->check(CLI::Range(1e-6, 1e9));
    app.add_flag("--profile", options.profile, "also count messages and time inside MPI, for the record of the run");
    app.add_option("--estimate", estimate,
                   "print the cost of a problem of this size, as JSON: '{\"element\": \"T10\", \"nodes\": 9000, \"modes\": 100}'")
        ->type_name("SIZE");
    app.add_option("--radiate", options.radiate,
                   "instead of a job: solve the exterior air for the modes of this bank, and write it with multipoles to --bank")
        ->check(named)
        ->excludes("JOB", "--matrices", "--progress", "--validate", "--at", "--estimate");
    app.add_flag_callback(
        "--keys", [] { throw CLI::CallForVersion(base::write_key_tables(carillon::job::describe_job_keys()), 0); },
        "print the keys of jobs with defaults, ranges and meaning");
    app.set_version_flag("--version", base::describe("carillon-precompute"));
    // Words after "--" are for PETSc and SLEPc.
    const int own = static_cast<int>(std::find(argv, argv + argc, std::string_view("--")) - argv);
    options.solver_options.assign(argv + std::min(own + 1, argc), argv + argc);
    try {
      app.parse(own, argv);
      if (job.empty() && estimate.empty() && options.radiate.empty()) throw CLI::RequiredError("JOB");
    } catch (const CLI::ParseError& caught) {
      error = caught;
    }
  }

  /// Work that must be equal on all ranks; options of output and of rank 0's result files may differ.
  run::Given describe_work() const {
    std::string work = error                         ? "an invalid command line"
                       : !options.radiate.empty()    ? "--radiate"
                       : options.validate            ? "--validate"
                       : options.at_m                ? "--at"
                       : !options.matrices.empty()   ? "--matrices"
                       : !options.checkpoint.empty() ? "--checkpoint"
                                                     : "a job";
    for (const std::string& word : options.solver_options) work += " " + word;
    return {work, {work}};
  }

  bool only_asks() const { return error && error->get_exit_code() == 0; }  // --help or --version
};

/// Executes the command line.
base::Result carry_out(const petsc::Session& session, const CommandLine& words) {
  const bool speaks = session.rank() == 0;
  print_start(session, words.options.quiet || words.options.validate || words.options.at_m);
  petsc::reserve_blas_memory(PETSC_COMM_WORLD);
  if (words.options.validate) {
    const std::string text = run::validate_job(PETSC_COMM_WORLD, words.job, words.options);
    if (speaks) fmt::print("{}\n", words.options.json ? text : base::printable_lines(text));
    return {};
  }
  if (words.options.at_m) {
    const std::string table = run::list_modes_at(PETSC_COMM_WORLD, words.job, words.options);
    if (speaks) fmt::print("{}", table);
    return {};
  }
  const run::RunSummary summary = words.options.radiate.empty() ? run::run_job(PETSC_COMM_WORLD, words.job, words.options)
                                                                : run::radiate_bank(PETSC_COMM_WORLD, words.options);
  if (summary.is_stopped) {
    if (speaks) fmt::print(stderr, "carillon-precompute: {}\n", base::printable(summary.result));
    return {base::ResultKind::checkpointed, summary.result};
  }
  if (speaks && words.options.quiet && !summary.warning.empty())
    fmt::print(stderr, "carillon-precompute: warning: {}\n", base::printable(summary.warning));
  if (speaks && !words.options.quiet) {
    if (!summary.warning.empty()) fmt::print("warning: {}\n", base::printable(summary.warning));
    fmt::print("{}\n{}\n", base::printable(summary.bank.string()), base::printable_lines(summary.result));
  }
  return {};
}

/// Turns success and all errors into a result, its file and the exit code.
int finish_program(const petsc::Session& session, const CommandLine& words) {
  MPI_Comm failures = MPI_COMM_NULL;
  MPI_Comm_dup(MPI_COMM_WORLD, &failures);
  base::Result result;
  bool has_failed = false;
  try {
    run::check_same(PETSC_COMM_WORLD, "work", words.describe_work());
    if (!words.error) result = carry_out(session, words);
  } catch (...) {
    result = base::describe_error(std::current_exception(), "out of memory; use a coarser mesh or a machine with more memory");
    has_failed = true;
  }
  if (words.error && !has_failed) {
    result = {base::ResultKind::bad_input, words.error->what()};
    if (session.rank() == 0) words.app.exit(*words.error);
  }
  std::error_code error;
  result.is_resumable = result.kind != base::ResultKind::done && std::filesystem::exists(words.options.checkpoint, error);
  const int code = base::get_exit_code(result.kind);
  const bool speaks = session.rank() == 0;
  if (has_failed) {
    if (words.options.json && speaks) fmt::print("{}\n", run::describe_failure(result.message, code));
    run::end_in_error(failures, "carillon-precompute", words.result, result);
  } else if (speaks && !words.result.empty()) {
    base::write_result(words.result, result);
  }
  MPI_Comm_free(&failures);
  return code;
}

/// Under mpirun the first process prints.
int print_estimate(const CommandLine& words) {
  if (!base::is_first_of_all()) return 0;
  base::Result result;
  try {
    fmt::print("{}\n", run::predict_cost(words.estimate));
  } catch (const InputError& error) {
    fmt::print(stderr, "carillon-precompute: error: {}\n", base::show_message(error.what()));
    result = {base::ResultKind::bad_input, error.what()};
  }
  if (!words.result.empty()) base::write_result(words.result, result);
  return base::get_exit_code(result.kind);
}

int run_words(int argc, char** argv, const petsc::Session* session) {
  base::report_file_limit();
  std::string result;  // file; empty: none
  try {
    const CommandLine words(argc, argv);
    if (words.only_asks()) return base::is_first_of_all() ? words.app.exit(*words.error) : 0;
    if (!words.error && !words.estimate.empty()) return print_estimate(words);
    if (base::is_first_of_all()) result = words.result;
    run::end_on_signals("carillon-precompute", "the bank is unchanged or complete");
    if (!words.options.checkpoint.empty()) run::save_on_signals();
    std::optional<petsc::Session> own;
    return finish_program(session != nullptr ? *session : own.emplace(argc, argv, words.options.solver_options), words);
  } catch (const std::exception& error) {
    fmt::print(stderr, "carillon-precompute: error: {}\n", base::show_message(error.what()));
    if (!result.empty()) base::write_result(result, {base::ResultKind::system, error.what()});
    return kExitSystem;
  }
}

}  // namespace

int run_program(int argc, char** argv) { return run_words(argc, argv, nullptr); }

void prepare_forks() {
  (void)find_versions();
  (void)base::calc_sha256("");
  (void)petsc::describe_slow_kernels();
  petsc::reserve_blas_memory(PETSC_COMM_WORLD);
}

int run_program(const petsc::Session& session, std::vector<std::string> words) {
  std::vector<char*> pointers;
  for (std::string& word : words) pointers.push_back(word.data());
  pointers.push_back(nullptr);
  return run_words(static_cast<int>(words.size()), pointers.data(), &session);
}

}  // namespace carillon::run
