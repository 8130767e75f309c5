// Stage "assemble": K, M and the rigid-body data of the body.
#pragma once

#include "precompute/run/run.hpp"
#include "precompute/run/stages.hpp"

namespace carillon::run {

/// Finds the materials, assembles K and M, and integrates volumes and inertia. Warns of locking. Phase "assemble". Collective. Throws on
/// every rank: InputError, SolveError, SystemError, naming the body or the job's line.
AssembledSystem assemble_system(Run& run, const Setting& setting, const Body& body);

}  // namespace carillon::run
