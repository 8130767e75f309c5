// The commands of carillon: the options of each, and the function that does its work. A function gives the exit code, and throws
// InputError, SolveError and SystemError. command_line.cpp fills the options; its help texts say what they mean.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "jobs/queue/attempt/attempt.hpp"
#include "jobs/cli/options.hpp"
#include "jobs/cli/shared.hpp"
#include "jobs/front/explore/explore.hpp"
#include "jobs/front/hear/hear.hpp"
#include "jobs/queue/run.hpp"

namespace carillon::cli {

/// carillon submit: jobs into the store and the registry.
struct SubmitOptions {
  std::vector<std::string> words;
  ResourceOptions resources;
  bool has_pictures = false;
  bool wait = false, run = false, keep_going = false, is_quiet = false;
};
int run_submit(Shared& shared, const SubmitOptions& options);

/// carillon status: where jobs stand.
struct StatusOptions {
  std::vector<std::string> words;  // empty: all jobs
  bool watch = false, all = false;
};
int run_status(Shared& shared, const StatusOptions& options);

/// carillon log: what the solver printed.
struct LogOptions {
  std::string word;
  bool follow = false;
};
int run_log(Shared& shared, const LogOptions& options);

/// carillon cancel: ends jobs.
struct CancelOptions {
  std::vector<std::string> words;
};
int run_cancel(Shared& shared, const CancelOptions& options);

/// carillon retry: failed and cancelled jobs back into the queue.
struct RetryOptions {
  std::vector<std::string> words;
  ResourceOptions resources;
  bool all_failed = false;
};
int run_retry(Shared& shared, const RetryOptions& options);

/// carillon explain: would a job run, and why.
struct ExplainOptions {
  std::string word;
};
int run_explain(Shared& shared, const ExplainOptions& options);

/// carillon run: the queue of this machine, or all that is for Slurm.
struct QueueOptions {
  queue::RunOptions queue;
  std::string engine = "local";  // "local", "slurm"
};
int run_queue(Shared& shared, const QueueOptions& options);

/// carillon get: the banks of jobs.
struct GetOptions {
  std::vector<std::string> words;
  std::string to;  // empty: no copy
};
int run_get(Shared& shared, const GetOptions& options);

/// carillon gc: what no job refers to.
struct GcOptions {
  bool is_deleting = false;
};
int run_gc(Shared& shared, const GcOptions& options);

/// carillon verify: is everything in the store what it was.
struct VerifyOptions {
  std::vector<std::string> words;  // empty: the whole store
  bool repairs = false;
};
int run_verify(Shared& shared, const VerifyOptions& options);

/// carillon validate: carillon-precompute --validate in place of this program.
struct ValidateOptions {
  std::string word;
};
int run_validate(Shared& shared, const ValidateOptions& options);

/// carillon study: carillon-study in place of this program.
struct StudyOptions {
  std::vector<std::string> words;
};
int run_study(Shared& shared, const StudyOptions& options);

/// carillon report: the page about a bank.
struct ReportOptions {
  std::string word;
  std::filesystem::path folder;  // empty: the report of the store
  bool no_pictures = false, no_page = false;
};
int run_report(Shared& shared, const ReportOptions& options);

/// carillon hear: an object, and how it sounds.
struct HearOptions {
  hear::Order hear;
};
int run_hear(Shared& shared, const HearOptions& options);

/// carillon explore: a page on which bodies are struck.
struct ExploreOptions {
  explore::PageOrder explore;
  bool is_serving = false;
  int port = 0;
};
int run_explore(Shared& shared, const ExploreOptions& options);

/// carillon bank-for: the bank of a body, made if it is missing.
struct BankForOptions {
  std::string word;            // job file, or "-"
  std::filesystem::path name;  // of what comes on standard input, for messages and relative paths
  int first_line = 1;
  std::filesystem::path cache;   // empty: the default one
  std::filesystem::path result;  // file for the result, instead of a message; empty: none
  bool is_quiet = false;
};
int run_bank_for(Shared& shared, const BankForOptions& options);

/// carillon materials: the materials that can be named.
struct MaterialsOptions {
  std::vector<std::string> names;  // empty: all, a line each
};
int run_materials(Shared& shared, const MaterialsOptions& options);

/// carillon attempt: one attempt at one job. It needs neither registry nor profile.
struct AttemptOptions {
  attempt::Options attempt;
  std::string launcher;          // "alone", "mpirun", "srun"; empty: as attempt::Launcher::automatic
  std::string engine = "local";  // "local", "slurm"
};
int run_attempt(const AttemptOptions& options);

}  // namespace carillon::cli
