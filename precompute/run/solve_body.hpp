// The stages from a body to its modes, their decays and their error bars, and the checkpoint between them.
#pragma once

#include "precompute/eigen/solve_modes.hpp"
#include "precompute/run/body.hpp"
#include "precompute/run/errors.hpp"
#include "precompute/run/run.hpp"
#include "precompute/run/system.hpp"

namespace carillon::run {

struct SolvedBody {
  BodyProperties properties;
  eigen::Modes modes;
  ModeProperties errors;
};

/// Assembles K and M, finds the modes of the job's band, and estimates their errors: phases "assemble", "modes", "errors". K and M are gone
/// afterwards, and the elimination order of the body with them. Collective. Throws on every rank: InputError, SolveError, SystemError, with
/// the body and the job named; eigen::Stopped when a signal asked for a checkpoint.
SolvedBody solve_body(Run& run, const Setting& setting, Body& body);

/// Whether the job asks for more after the modes and their errors: the air, or coupled modes.
bool is_more_to_come(const job::JobSpec& job);

}  // namespace carillon::run
