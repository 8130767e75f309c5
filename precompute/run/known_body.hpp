// A job whose modes are known: from formulas to the bank, without a mesh and a solve.
#pragma once

#include "precompute/run/run.hpp"
#include "precompute/run/run_job.hpp"

namespace carillon::run {

/// Writes the bank and its record, on rank 0; the other ranks have nothing to do. Collective. Throws as run_job().
RunSummary write_known_body(Run& run);

/// What --validate says of such a job: its modes, and the seconds and bytes that they took here, on one rank as on many.
std::string validate_known_body(const Run& run);

/// The modes of the job's body at options.at_m, as a table with commas: number, name, frequency, phi [kg^-1/2], |phi| / omega. Throws
/// InputError where the job's body is not such a one. Collective.
std::string list_modes_at(const comm::Communicator& comm, const std::filesystem::path& job_file, const RunOptions& options);

}  // namespace carillon::run
