// The stages "assemble", "modes" and "errors", with checkpoints between them.
#pragma once

#include "precompute/run/run.hpp"
#include "precompute/run/stages.hpp"

namespace carillon::run {

/// Assembles K and M, finds the modes of the job's band, and estimates their errors. Frees K, M and the elimination order of the body.
/// Collective. Throws on every rank: InputError, SolveError, SystemError, naming the body and the job; eigen::Stopped when a signal
/// requested a checkpoint.
SolvedBody solve_body(Run& run, const Setting& setting, Body& body);

/// True if air or coupled modes follow the modes and their errors.
bool has_later_stages(const job::JobSpec& job);

}  // namespace carillon::run
