// The stage from modes to their error bars and decays.
#pragma once

#include <vector>

#include "precompute/eigen/solve_modes.hpp"
#include "precompute/fem/error_bars/error_bars.hpp"
#include "precompute/fem/energy.hpp"
#include "precompute/fem/supports.hpp"
#include "precompute/run/body.hpp"
#include "precompute/run/run.hpp"
#include "precompute/run/system.hpp"

namespace carillon::run {

struct ModeProperties {
  std::vector<double> decay_per_s;  // (m)
  fem::EnergyShares shares;         // of the materials; empty when there is one
  fem::Supports supports;           // energy and reactions at the fixed nodes
  error_bars::ErrorBars bars;
};

/// Decay rates, support losses and error bars of the modes. Phase "errors". Collective. Throws on every rank: SolveError, SystemError, with
/// the body and the job named.
ModeProperties calc_errors(Run& run, const Body& body, const AssembledSystem& system, const eigen::Modes& modes);

}  // namespace carillon::run
