// The commands of carillon: options and functions. A function returns the exit code and throws InputError, SolveError and SystemError.
// Options are described by the help texts in command_line.cpp.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "jobs/cli/options.hpp"
#include "jobs/cli/shared.hpp"
#include "jobs/front/explore/explore.hpp"
#include "jobs/front/hear/hear.hpp"
#include "jobs/queue/attempt/attempt.hpp"
#include "jobs/queue/run.hpp"

namespace carillon::cli {

/// carillon submit: adds jobs to store and registry.
struct SubmitOptions {
  std::vector<std::string> words;
  ResourceOptions resources;
  bool has_pictures = false;
  bool wait = false, run = false, keep_going = false, is_quiet = false;
};
int run_submit(Shared& shared, const SubmitOptions& options);

/// carillon status: states of jobs.
struct StatusOptions {
  std::vector<std::string> words;  // empty: all jobs
  bool watch = false, all = false;
};
int run_status(Shared& shared, const StatusOptions& options);

/// carillon log: output of the solver.
struct LogOptions {
  std::string word;
  bool follow = false;
};
int run_log(Shared& shared, const LogOptions& options);

/// carillon cancel: cancels jobs.
struct CancelOptions {
  std::vector<std::string> words;
};
int run_cancel(Shared& shared, const CancelOptions& options);

/// carillon retry: requeues failed and cancelled jobs.
struct RetryOptions {
  std::vector<std::string> words;
  ResourceOptions resources;
  bool all_failed = false;
};
int run_retry(Shared& shared, const RetryOptions& options);

/// carillon explain: whether a job would run, and why.
struct ExplainOptions {
  std::string word;
};
int run_explain(Shared& shared, const ExplainOptions& options);

/// carillon run: works through the queue of this machine or of Slurm.
struct QueueOptions {
  queue::RunOptions queue;
  std::string engine = "local";  // "local", "slurm"
};
int run_queue(Shared& shared, const QueueOptions& options);

/// carillon get: paths or copies of banks.
struct GetOptions {
  std::vector<std::string> words;
  std::string to;  // empty: no copy
};
int run_get(Shared& shared, const GetOptions& options);

/// carillon gc: removes unreferenced entries of the store.
struct GcOptions {
  bool is_deleting = false;
};
int run_gc(Shared& shared, const GcOptions& options);

/// carillon verify: integrity check of the store.
struct VerifyOptions {
  std::vector<std::string> words;  // empty: the whole store
  bool repairs = false;
};
int run_verify(Shared& shared, const VerifyOptions& options);

/// carillon validate: replaces this process by carillon-precompute --validate.
struct ValidateOptions {
  std::string word;
};
int run_validate(Shared& shared, const ValidateOptions& options);

/// carillon report: the report of a bank.
struct ReportOptions {
  std::string word;
  std::filesystem::path folder;  // empty: the report of the store
  bool no_pictures = false, no_page = false;
};
int run_report(Shared& shared, const ReportOptions& options);

/// carillon hear: the sound of an object.
struct HearOptions {
  hear::Order hear;
};
int run_hear(Shared& shared, const HearOptions& options);

/// carillon explore: a web page with playable bodies.
struct ExploreOptions {
  explore::PageOrder explore;
  bool is_serving = false;
  int port = 0;
};
int run_explore(Shared& shared, const ExploreOptions& options);

/// carillon bank-for: the bank of a body, computed if missing.
struct BankForOptions {
  std::string word;            // job file, or "-"
  std::filesystem::path name;  // of standard input, for messages and relative paths
  int first_line = 1;
  std::filesystem::path cache;   // empty: the default one
  std::filesystem::path result;  // result file instead of a message; empty: none
  bool is_quiet = false;
};
int run_bank_for(Shared& shared, const BankForOptions& options);

/// carillon materials: the table of materials.
struct MaterialsOptions {
  std::vector<std::string> names;  // empty: all, one line each
};
int run_materials(Shared& shared, const MaterialsOptions& options);

/// carillon mesh2faust: a surface to a Faust library, with the arguments of Faust's program.
struct Mesh2FaustOptions {
  std::filesystem::path file;
  std::string name = "modalModel";
  std::vector<double> material;  // E [Pa], nu, rho [kg/m3], and optionally alpha [1/s], beta [s]; empty: aluminium
  double min_hz = 20.0, max_hz = 10000.0;
  std::size_t modes = 20, solved = 0;  // solved: accepted, without effect
  std::vector<std::size_t> vertices;   // to be struck; empty: by max_points
  std::optional<std::size_t> max_points;
  std::optional<double> accuracy_cents;
  bool has_control = false, shows_frequencies = false, is_verbose = false;
};
int run_mesh2faust(Shared& shared, const Mesh2FaustOptions& options);

/// carillon attempt: one attempt at one job. Uses neither registry nor profile.
struct AttemptOptions {
  attempt::Options attempt;
  std::string launcher;          // "alone", "mpirun", "srun"; empty: as attempt::Launcher::automatic
  std::string engine = "local";  // "local", "slurm"
};
int run_attempt(const AttemptOptions& options);

}  // namespace carillon::cli
