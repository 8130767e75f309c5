// One run of carillon-precompute as its steps see it.
#pragma once

#include <mpi.h>

#include <memory>
#include <string>

#include "precompute/io/progress_file.hpp"
#include "precompute/io/run_options.hpp"
#include "precompute/io/run_record.hpp"
#include "precompute/job/job_spec.hpp"
#include "runtime/base/error.hpp"

namespace carillon::io {

class CheckpointFile;

struct Run {
  Run(MPI_Comm communicator, const RunOptions& wishes) : comm(communicator), options(wishes), stations(communicator, wishes.quiet) {
    MPI_Comm_rank(comm, &rank);
    MPI_Comm_size(comm, &ranks);
  }

  MPI_Comm comm;
  int rank = 0;
  int ranks = 1;
  job::JobSpec job;  // the same on every rank
  RunOptions options;
  Stations stations;
  std::unique_ptr<ProgressFile> progress;      // on rank 0, if it is asked for
  std::shared_ptr<CheckpointFile> checkpoint;  // if it is asked for
};

/// Runs a collective step whose errors cannot know what it works on, and names it in them. All ranks throw alike.
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

}  // namespace carillon::io
