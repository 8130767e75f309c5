// One job from its file to its bank: the order of the stages.
#pragma once

#include <filesystem>

#include "precompute/comm/communicator.hpp"
#include "precompute/run/run_options.hpp"
#include "precompute/run/stages.hpp"

namespace carillon::run {

/// Reads the job on rank 0 and runs it on all ranks: mesh, partition, assembly, modes, error bars, bank. Writes the bank and
/// <bank>.resolved.json, each atomically; checks before the solve that they can be written. Unused words of options.solver_options are an
/// error, before anything is written. Progress goes to standard output (unless quiet) and warnings to standard error, on rank 0.
/// Collective. Throws the same on every rank: InputError, SolveError, SystemError.
RunSummary run_job(const comm::Communicator& comm, const std::filesystem::path& job_file, const RunOptions& options);

}  // namespace carillon::run
