// Stage "modes": the eigensolver on the job's band.
#pragma once

#include "precompute/run/run.hpp"
#include "precompute/run/stages.hpp"

namespace carillon::run {

/// Options of the eigensolver.
eigen::Options make_options(const job::JobSpec& job, const Setting& setting);

/// Lower end of the bank's band [Hz]: from the job, or higher if rounding hides lower modes.
double find_low_hz(const job::JobSpec& job, const eigen::Modes& modes);

/// Positions and components of the free nodes; moves the elimination order out of the body.
eigen::NodeLayout make_layout(Body& body);

/// All modes of the job's band, with the proof of completeness. Warns of modes outside the band and of mechanisms. Moves the elimination
/// order out of the body. Phase "modes". Collective. Throws on every rank: InputError, SolveError, SystemError, naming the body and the
/// job; eigen::Stopped when a signal requested a checkpoint.
eigen::Modes find_modes(Run& run, const Setting& setting, Body& body, const AssembledSystem& system);

}  // namespace carillon::run
