// Stage "coupling": the energy that couples modes in large motion.
#pragma once

#include "precompute/run/run.hpp"
#include "precompute/run/stages.hpp"

namespace carillon::run {

/// Condenses the quartic energy of the modes requested by "nonlinear", from the unrounded shapes. Assembles K and M again. Warns if
/// condensed motions are not much faster than the coupled modes. A run stopped here resumes from its modes. Phase "coupling". Collective.
/// Throws on every rank: InputError, SolveError, SystemError, naming the body and the job.
CouplingReport couple_modes(Run& run, const Solution& found);

}  // namespace carillon::run
