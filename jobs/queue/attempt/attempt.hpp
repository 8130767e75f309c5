// One attempt at one job, from its folder of work to its bank in the store. The same program runs here, under `carillon run` and inside a
// batch script of Slurm; it never touches the registry.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "jobs/store/records.hpp"

namespace carillon::attempt {

enum class Launcher { automatic, alone, mpirun, srun };  // automatic: alone for one rank, else mpirun

struct Options {
  std::filesystem::path work;  // work/ab/<id> of a store
  std::filesystem::path root;  // that store, for ranks that have to find the folder themselves
  std::string id;              // and the job
  int ranks = 1;
  double memory_gb = 0.0;        // admitted, for the record; 0: unknown
  double memory_limit_gb = 0.0;  // the job's "memory_gb", limit for all its processes together; 0: none
  double time_limit_s = 0.0;     // of this attempt; 0: none
  std::string token;             // 32 hex digits; empty: made here
  Launcher launcher = Launcher::automatic;
  std::vector<std::string> mpirun_options;  // words for mpirun or srun, before ours: which hosts, by which network
  bool has_pictures = false;       // draw the first modes for the report now, where memory_gb has room; carillon report does it later
  bool is_simulation = false;      // of carillon-simulate, as the request in the folder says: found out here
  bool is_prediction = false;      // do not solve: find out what it needs (carillon-precompute --validate), into prediction.json
  double grace_s = 60.0;           // from "save and stop" to the kill
  double hang_s = 600.0;           // without progress, while a rank does not work
  double silence_s = 24 * 3600.0;  // without progress, whatever the ranks do
};

/// What carillon-draw and its X server take for the pictures of a report [GB]: 0.54 measured, for small bodies and large ones. It draws
/// when the solver has ended, so a job needs the larger of the two.
inline constexpr double kDrawGb = 0.8;

/// Not an error: another attempt has locked this folder, and this one did nothing (EX_TEMPFAIL).
inline constexpr int kExitBusy = 75;

/// Works on the job until it ends: ends what earlier attempts left running, starts the solver, waits for it, verifies the bank and
/// publishes it. SIGUSR1, SIGTERM, SIGINT and SIGHUP ask the solver to save and stop; a second SIGTERM or SIGINT ends it at once. The end
/// is in outcome.json of the folder (of the bank's folder when done), written last. Takes over the signals of the process and makes it
/// adopt orphans: for a process of its own. Returns the exit code: 0, 2, 3, 4 (failed for good), kExitCheckpointed or kExitBusy.
/// InputError: `work` is no folder of work of a store. SystemError: the folder cannot be written at all.
int run_attempt(const Options& options);

/// The command line that does this, for `program` (carillon itself): {program, "attempt", ...}.
std::vector<std::string> make_arguments(const std::filesystem::path& program, const Options& options);

/// What --validate printed, in the folder of work.
inline constexpr const char* kPredictionFile = "prediction.json";

}  // namespace carillon::attempt
