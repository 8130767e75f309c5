// carillon-simulate: deforming and moving bodies to sound, on MPI ranks.
#include <fmt/core.h>
#include <mpi.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <string>

#include "precompute/job/simulation.hpp"
#include "precompute/run/end_in_error.hpp"
#include "precompute/run/interrupt.hpp"
#include "precompute/simulation/simulate.hpp"
#include "runtime/base/environment.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/file_limit.hpp"
#include "runtime/base/keys.hpp"
#include "runtime/base/printable.hpp"
#include "runtime/base/result.hpp"
#include "runtime/base/version.hpp"

namespace {

using namespace carillon;

/// Lifetime of MPI.
class Session {
 public:
  Session(int argc, char** argv) { MPI_Init(&argc, &argv); }
  ~Session() { MPI_Finalize(); }
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;
};

struct CommandLine {
  CLI::App app{
      "Simulates bodies that deform and move, struck and touching, and writes their sound.\n"
      "Start it on several ranks with: mpirun -np N carillon-simulate JOB.json",
      "carillon-simulate"};
  std::string job, result;
  simulation::SimulateOptions options;

  CommandLine() {
    const CLI::Validator named([](const std::string& file) { return file.empty() ? "the name of the file is empty" : ""; }, "FILE");
    app.failure_message(
        [](const CLI::App* asked, const CLI::Error& error) { return base::printable_lines(CLI::FailureMessage::simple(asked, error)); });
    app.add_option("JOB", job, "job file (JSON with // comments)")->required();
    app.add_flag("-q,--quiet", options.quiet, "nothing on standard output; warnings and errors are on standard error");
    app.add_option("--sound", options.sound, "write the sound to this WAV file, whatever the job says")->check(named);
    app.add_option("--spectrogram", options.spectrogram, "draw the spectrogram of the sound to this PNG file")->check(named);
    app.add_option("--surface", options.surface, "record the surface to this file, for carillon-render")->check(named);
    app.add_option("--motion", options.motion, "write the motion to this VTKHDF file")->check(named);
    app.add_option("--record", options.record, "write figures and energies of the run to this file, JSON")->check(named);
    app.add_option("--progress", options.progress, "append progress to this file, one JSON object per line")->check(named);
    app.add_option("--checkpoint", options.checkpoint,
                   "resume from this file if it exists, and save to it; SIGUSR1 and SIGTERM then save and end with 85")
        ->check(named);
    app.add_option("--checkpoint-every", options.checkpoint_every_s, "seconds between two saves")
        ->check(CLI::Range(0.0, 1e9))
        ->capture_default_str();
    app.add_option("--result", result, "write how the run ended to this file, a JSON object (docs/howto/jobs.md)")->check(named);
    CLI::Option* validate =
        app.add_flag("--validate", options.validate, "check the job and its meshes, predict step, time and memory, and simulate nothing");
    app.add_option("--patience", options.patience_s,
                   "with --validate: time limit in seconds; larger meshes are replaced by coarser ones, with a note")
        ->check(CLI::Range(0.0, 1e6))
        ->capture_default_str()
        ->needs(validate);
    app.add_flag("--json", options.json, "with --validate: print one JSON object")->needs(validate);
    app.add_flag_callback(
        "--keys", [] { throw CLI::CallForVersion(carillon::base::write_key_tables(carillon::job::describe_simulation_keys()), 0); },
        "print the keys of jobs with defaults, ranges and meaning");
    app.set_version_flag("--version", base::describe("carillon-simulate"));
  }
};

int run_program(const CommandLine& words) {
  const comm::Communicator comm(MPI_COMM_WORLD);
  base::Result result;
  try {
    if (comm.is_root() && !words.options.quiet && !words.options.validate)
      fmt::print("carillon-simulate {} on {} rank{}\n", base::get_number(), comm.size(), comm.size() == 1 ? "" : "s");
    const simulation::SimulateSummary summary = simulation::simulate(comm, words.job, words.options);
    if (summary.is_stopped) {
      if (comm.is_root()) fmt::print(stderr, "carillon-simulate: {}\n", base::printable(summary.result));
      result = {base::ResultKind::checkpointed, summary.result};
    } else if (comm.is_root() && (words.options.validate || !words.options.quiet)) {
      fmt::print("{}\n", words.options.json ? summary.result : base::printable_lines(summary.result));
    }
  } catch (...) {
    result = base::describe_error(std::current_exception(), "out of memory; use a coarser mesh or a machine with more");
    std::error_code error;
    result.is_resumable = std::filesystem::exists(words.options.checkpoint, error);
    return run::end_in_error(MPI_COMM_WORLD, "carillon-simulate", words.result, result);
  }
  std::error_code error;
  result.is_resumable = result.kind != base::ResultKind::done && std::filesystem::exists(words.options.checkpoint, error);
  if (comm.is_root() && !words.result.empty()) base::write_result(words.result, result);
  return base::get_exit_code(result.kind);
}

}  // namespace

int main(int argc, char** argv) {
  base::report_file_limit();
  CommandLine words;
  run::end_on_signals("carillon-simulate", "files of earlier runs were not touched, or new ones are whole");
  try {
    words.app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (!base::is_first_of_all()) return error.get_exit_code() == 0 ? 0 : kExitInput;
    return words.app.exit(error) == 0 ? 0 : kExitInput;
  }
  if (!words.options.checkpoint.empty()) run::save_on_signals();
  base::isolate_lone_process();
  const Session session(argc, argv);
  return run_program(words);
}
