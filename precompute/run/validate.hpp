// Checks a job and predicts its cost without solving it.
#pragma once

#include <mpi.h>

#include <filesystem>
#include <string>

#include "precompute/comm/communicator.hpp"
#include "precompute/run/run_options.hpp"

namespace carillon::run {

/// Reads the job, makes or reads its mesh, finds the materials, assembles K and M, and analyses the factorisation: all that a run does
/// before it searches, so that whatever would end a run before then ends this, with the same words. Then predicts modes, memory and time.
/// The modes are counted by two factorisations, or else estimated from volume and surface. All of it takes options.patience_s of the clock
/// since the process began: a step that is not expected to fit what is left of it is not begun, what it would find is estimated, and the
/// answer says so and how to have it. Returns what main prints: lines for people, or one JSON object (options.json).
/// One rank only: InputError on several. Throws InputError, SolveError, SystemError as run_job(). Collective.
std::string validate_job(const comm::Communicator& comm, const std::filesystem::path& job_file, const RunOptions& options);

/// {"ok": false, "error": message, "code": exit code}, what stands on standard output with --json when the job is not well.
std::string describe_failure(const std::string& message, int code);

}  // namespace carillon::run
