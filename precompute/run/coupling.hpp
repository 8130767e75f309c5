// The stage from modes to the energy that couples them in large motion.
#pragma once

#include <string>

#include "precompute/run/accuracy.hpp"
#include "precompute/run/run.hpp"
#include "runtime/bank/quartic_energy.hpp"

namespace carillon::run {

struct CouplingReport {
  bank::QuarticEnergy energy;  // on rank 0; modes are numbers of the bank. Empty where nothing is coupled
  std::string result;          // "30 coupled modes up to 2710 Hz, ..."; empty where the job asks for nothing
};

/// Condenses the quartic energy of the modes that the job's "nonlinear" asks for, from the shapes before they are rounded. K and M are
/// assembled once more. Warns where a condensed motion is not much faster than the coupled modes. A run that is stopped here resumes from
/// its modes. Phase "coupling". Collective. Throws on every rank: InputError, SolveError, SystemError, with the body and the job named.
CouplingReport couple_modes(Run& run, const AccurateBody& found);

}  // namespace carillon::run
