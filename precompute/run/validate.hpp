// Checks a job and predicts its modes and memory without solving it; cost of a problem of a given size.
#pragma once

#include <filesystem>
#include <string>

#include "precompute/comm/communicator.hpp"
#include "precompute/run/run_options.hpp"

namespace carillon::run {

/// size: {"element": "T10" (or "T4"), "nodes": N, "modes": M (of the band; default 200)}. Returns one JSON object on one line:
/// cpu_seconds and phase_seconds of one rank on the reference machine of the cost model, memory_bytes by ranks, factor (entries, flops),
/// factorisations, right_sides. Throws InputError for invalid text. No MPI, no files.
std::string predict_cost(const std::string& size);

/// Runs the stages before the eigensolver (job, mesh, materials, assembly, analysis of the factorisation), with the errors of a run, and
/// predicts the number of modes and the memory of 1, 2 and 4 ranks. Returns text, or one JSON object (options.json). One rank only:
/// InputError on several. Throws InputError, SolveError, SystemError as run_job(). Collective.
std::string validate_job(const comm::Communicator& comm, const std::filesystem::path& job_file, const RunOptions& options);

/// {"ok": false, "error": message, "code": exit code}: standard output of a failed --validate --json.
std::string describe_failure(const std::string& message, int code);

}  // namespace carillon::run
