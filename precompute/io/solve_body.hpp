// From the pieces of a body to its modes, their decays and their error bars.
#pragma once

#include <vector>

#include "precompute/eigen/solve_modes.hpp"
#include "precompute/estimate/error_bars.hpp"
#include "precompute/fem/assemble.hpp"
#include "precompute/fem/materials.hpp"
#include "precompute/fem/supports.hpp"
#include "precompute/io/body.hpp"
#include "precompute/io/run.hpp"

namespace carillon::io {

struct SolvedBody {
  fem::Materials materials;
  std::vector<double> volume_m3;  // of each material
  fem::RigidBody rigid;
  eigen::Modes modes;
  std::vector<double> decay_per_s;  // (m)
  fem::Supports supports;
  estimate::ErrorBars bars;
};

/// The solver's, of the job.
eigen::Options make_options(const Run& run, const Setting& setting);
/// Where the bank's band begins: as the job says, or above it where rounding lets nothing slower be told from rigid motions.
double find_low_hz(const job::JobSpec& job, const eigen::Modes& modes);
/// Where the free nodes are; takes the elimination order from the pieces.
eigen::NodeLayout make_layout(fem::Distribution& pieces);

/// The first half of solve_body(): materials, K and M, volumes, the rigid body. Station "assemble". Collective, throws as solve_body().
fem::System assemble_body(Run& run, const Setting& setting, Body& body, SolvedBody& solved);

/// Assembles K and M, solves for the modes of the job's band, and says how wrong they can be. Stations "assemble", "modes", "errors". K and
/// M are gone afterwards, and the elimination order of the body with them.
/// Collective. Throws on every rank: InputError, SolveError, SystemError, with the body and the job named.
SolvedBody solve_body(Run& run, const Setting& setting, Body& body);

}  // namespace carillon::io
