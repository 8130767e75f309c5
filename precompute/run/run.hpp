// State of one run of carillon-precompute.
#pragma once

#include <mpi.h>

#include <filesystem>
#include <memory>
#include <string>

#include "precompute/comm/communicator.hpp"
#include "precompute/job/job_spec.hpp"
#include "precompute/run/progress.hpp"
#include "precompute/run/run_log.hpp"
#include "precompute/run/run_options.hpp"
#include "runtime/base/error.hpp"

namespace carillon::io {
class CheckpointFile;
}

namespace carillon::run {

struct Run {
  Run(const comm::Communicator& communicator, const RunOptions& run_options)
      : comm(communicator), options(run_options), log(communicator, run_options.quiet) {}

  comm::Communicator comm;
  job::JobSpec job;            // the same on every rank
  std::filesystem::path bank;  // job.bank as opened
  RunOptions options;
  RunLog log;
  std::unique_ptr<ProgressReporter> progress;      // on rank 0, if requested
  std::shared_ptr<io::CheckpointFile> checkpoint;  // if requested
};

/// Runs a collective step and prefixes its errors with the source. All ranks throw alike.
template <class Step>
auto name_errors(const std::string& source, const Run& run, Step&& step) {
  try {
    return step();
  } catch (const InputError& error) {
    throw InputError(source + ": " + error.what());
  } catch (const SolveError& error) {
    throw SolveError(source + " (job " + run.job.file.string() + "): " + error.what());
  }
}

/// Reads the job on rank 0 into run.job on every rank and checks everything that needs no mesh: solver options, and that outputs can be
/// written. Collective. Throws InputError on every rank.
void open_job(Run& run, const std::filesystem::path& file, job::BankKey bank = job::BankKey::required);

}  // namespace carillon::run
