// Stage "air": sound of the modes in the air.
#pragma once

#include "precompute/run/run.hpp"
#include "precompute/run/stages.hpp"
#include "runtime/bank/bank.hpp"

namespace carillon::run {

/// Adds the multipoles of all modes to the bank (rank 0 only), as the job's "radiation" says. With a checkpoint, solved wave numbers are
/// kept in a file next to it. Phase "air". Collective. Throws on every rank: InputError, SolveError, SystemError; eigen::Stopped when a
/// signal requested a checkpoint.
AirReport add_air(Run& run, bank::Bank& bank);

/// Reads the bank options.radiate, adds the multipoles of all modes by boundary elements, and writes it to options.bank, which may be the
/// same file. The same bytes on any number of ranks. Resumes from options.checkpoint. Collective. Throws as run_job().
RunSummary radiate_bank(const comm::Communicator& comm, const RunOptions& options);

}  // namespace carillon::run
