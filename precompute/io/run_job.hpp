// One job from its file to its bank: the order of the stations.
#pragma once

#include <mpi.h>

#include <filesystem>

#include "runtime/bank/bank.hpp"

namespace carillon::io {

/// What main prints at the end; filled on rank 0.
struct RunSummary {
  std::filesystem::path bank;
  std::filesystem::path resolved;
  bank::Counts counts;
  std::size_t modes = 0;
  double first_hz = 0.0;
  double last_hz = 0.0;
  bool complete = true;
};

/// Reads the job on rank 0 and carries it out on all ranks: mesh, partition, assembly, modes, bank. Writes the bank and, beside it,
/// <bank>.resolved.json, each whole or not at all; whether they can be written is found out before the solve.
/// Progress goes to standard output and warnings to standard error, both on rank 0; quiet leaves the progress away.
/// Collective. Throws the same on every rank: InputError, SolveError, SystemError.
RunSummary run_job(MPI_Comm comm, const std::filesystem::path& job_file, bool quiet);

}  // namespace carillon::io
