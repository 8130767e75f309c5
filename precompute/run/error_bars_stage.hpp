// Stage "errors": error bars, decays and support losses of the modes.
#pragma once

#include "precompute/run/run.hpp"
#include "precompute/run/stages.hpp"

namespace carillon::run {

/// Collective. Throws on every rank: SolveError, SystemError, naming the body and the job.
ModeProperties calc_errors(Run& run, const Body& body, const AssembledSystem& system, const eigen::Modes& modes);

}  // namespace carillon::run
