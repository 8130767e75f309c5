// Jobs with known modes: from formulas or tables to the bank, without a mesh and a solve.
#pragma once

#include <string>

#include "precompute/run/run.hpp"
#include "precompute/run/stages.hpp"

namespace carillon::run {

/// Refuses such a job in a build without the component ANALYTIC. Throws InputError.
void check_known_body(const job::JobSpec& job);

/// Writes the bank and its record on rank 0; the other ranks are idle. Collective. Throws as run_job().
RunSummary write_known_body(Run& run);

/// Output of --validate: modes, and the seconds and bytes measured here, the same for any number of ranks.
std::string validate_known_body(const Run& run);

/// The modes of the job's body at options.at_m, comma-separated: number, name, frequency, phi [kg^-1/2], |phi| / omega. Collective. Throws
/// InputError for jobs without known modes.
std::string list_modes_at(const comm::Communicator& comm, const std::filesystem::path& job_file, const RunOptions& options);

}  // namespace carillon::run
