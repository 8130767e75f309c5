// The stage from a system to its modes.
#pragma once

#include "precompute/eigen/solve_modes.hpp"
#include "precompute/run/body.hpp"
#include "precompute/run/run.hpp"
#include "precompute/run/system.hpp"

namespace carillon::run {

/// The eigensolver's options for the job.
eigen::Options make_options(const job::JobSpec& job, const Setting& setting);

/// Lower end of the bank's band [Hz]: as the job says, or above it where rounding hides what is slower.
double find_low_hz(const job::JobSpec& job, const eigen::Modes& modes);

/// Positions and components of the free nodes; moves the elimination order out of the pieces.
eigen::NodeLayout make_layout(Body& body);

/// All modes of the job's band, with the proof that they are all. Warns of modes outside the band and of mechanisms. The elimination order
/// of the body is gone afterwards. Phase "modes". Collective. Throws on every rank: InputError, SolveError, SystemError, with the body and
/// the job named; eigen::Stopped when a signal asked for a checkpoint.
eigen::Modes find_modes(Run& run, const Setting& setting, Body& body, const AssembledSystem& system);

}  // namespace carillon::run
