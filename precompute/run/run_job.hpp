// One job from its file to its bank: the order of the stages.
#pragma once

#include <mpi.h>

#include <filesystem>
#include <string>

#include "precompute/comm/communicator.hpp"
#include "precompute/run/run_options.hpp"

namespace carillon::run {

/// What main prints at the end; filled on rank 0.
struct RunSummary {
  std::filesystem::path bank;
  std::filesystem::path resolved;
  std::string result;       // "227 modes in 20 .. 20000 Hz ...": how many, why no more, how wrong
  std::string warning;      // of error bars that can be heard, with the correction; empty when there is none
  bool is_stopped = false;  // a signal ended the run, and there is a checkpoint; result says so
};

/// Reads the job on rank 0 and carries it out on all ranks: mesh, partition, assembly, modes, error bars, bank. Writes the bank and
/// <bank>.resolved.json, each whole or not at all; whether they can be written is checked before the solve.
/// A word of options.solver_options that the solve does not use is an error, before anything is written. Progress goes to standard output
/// and warnings to standard error, both on rank 0; quiet leaves the progress away. Collective. Throws the same on every rank: InputError,
/// SolveError, SystemError.
RunSummary run_job(const comm::Communicator& comm, const std::filesystem::path& job_file, const RunOptions& options);

}  // namespace carillon::run
