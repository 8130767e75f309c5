// The stage from a bank to its sound in the air.
#pragma once

#include <string>

#include "precompute/run/run.hpp"
#include "precompute/run/run_job.hpp"
#include "runtime/bank/bank.hpp"

namespace carillon::run {

/// What the stage did and why, in words; empty where the job asks for nothing.
struct AirReport {
  bool is_solved = false;
  std::string why;
  std::string result;  // "boundary elements ..., error -41 dB"
};

/// Adds the multipoles of all modes to the bank, which rank 0 alone has, as the job's "radiation" says. Wave numbers that are solved are
/// kept next to the checkpoint, if there is one, until all are solved. Phase "air". Collective. Throws on every rank: InputError,
/// SolveError, SystemError; eigen::Stopped when a signal asked for a checkpoint.
AirReport add_air(Run& run, bank::Bank& bank);

/// Reads the bank options.radiate, adds the multipoles of all modes by boundary elements, and writes it to options.bank, which may be the
/// same file. The same bytes on any number of ranks. Resumes from options.checkpoint. Collective. Throws as run_job().
RunSummary radiate_bank(const comm::Communicator& comm, const RunOptions& options);

}  // namespace carillon::run
