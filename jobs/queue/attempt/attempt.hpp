// One attempt at one job: from its folder of work to a published bank. Runs as a process of its own, started by `carillon run` or by a
// batch script of Slurm. Does not use the registry.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "jobs/store/records.hpp"

namespace CLI {
class App;
}

namespace carillon::attempt {

enum class Launcher { automatic, alone, mpirun, srun };  // automatic: one rank alone, more by mpirun

struct Options {
  std::filesystem::path work;  // work/ab/<id> of a store
  int ranks = 1;
  double memory_gb = 0.0;        // admitted; 0: unknown
  double memory_limit_gb = 0.0;  // "memory_gb" of the job: limit for all processes together; 0: none
  double time_limit_s = 0.0;     // of this attempt; 0: none
  std::string token;             // 32 hex digits; empty: a new one
  Launcher launcher = Launcher::automatic;
  std::vector<std::string> mpirun_options;  // arguments of mpirun or srun
  bool has_pictures = false;                // draw the first modes for the report if memory_gb allows
  bool is_simulation = false;               // of carillon-simulate; set by run_attempt()
  bool is_prediction = false;               // only predict time and memory (carillon-precompute --validate), into prediction.json
  double grace_s = 60.0;                    // from "save and stop" to SIGTERM
  double hang_s = 600.0;                    // without output while a rank uses no CPU time: hung
  double silence_s = 24 * 3600.0;           // without output at all: hung
  // Runs carillon-precompute on one rank with these words, in a fork; none: the program is started.
  std::function<int(const std::vector<std::string>& words)> solver = {};
};

inline constexpr int kMaxRanks = 1'000'000;

/// Memory of carillon-draw and its X server [GB]; 0.54 measured, independent of the body. It runs after the solver, so a job needs the
/// larger of the two.
inline constexpr double kDrawGb = 0.8;

/// Exit code when another attempt holds the lock of the folder (EX_TEMPFAIL).
inline constexpr int kExitBusy = 75;

/// Ends leftover processes of earlier attempts, runs the solver, verifies the bank and publishes it. SIGUSR1, SIGTERM, SIGINT and SIGHUP
/// ask the solver to save and stop; a second SIGTERM or SIGINT ends it at once. Writes outcome.json last (into the bank's folder if done).
/// Takes over the signals of the process and makes it a subreaper. Returns the exit code: 0, 2, 3, 4 (permanent failure), kExitCheckpointed
/// or kExitBusy. InputError: `work` is not a folder of work. SystemError: the folder cannot be written.
int run_attempt(const Options& options);

/// Adds the options that make_arguments() writes to a command line.
void add_options(CLI::App& app, Options& options);

/// The command line for run_attempt(): {program, "attempt", ...}; `program`: carillon.
std::vector<std::string> make_arguments(const std::filesystem::path& program, const Options& options);

/// Output of --validate, in the folder of work.
inline constexpr const char* kPredictionFile = "prediction.json";

}  // namespace carillon::attempt
