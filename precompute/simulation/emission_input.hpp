// Receivers, options and surfaces of a job's sound, as emission input.
#pragma once

#include <string>
#include <vector>

#include "precompute/job/simulation.hpp"
#include "precompute/simulation/emission/emission.hpp"
#include "precompute/simulation/transient/domain.hpp"

namespace carillon::simulation {

emission::Options make_emission_options(const job::SimulationSpec& spec, int steps_per_sample, bool is_resumed);

/// Warnings for receivers inside an obstacle, which receive no sound.
std::vector<std::string> find_deaf_receivers(const job::SimulationSpec& spec);

/// Each triangle on the rank that owns its lowest node.
emission::SurfacePart make_surface_part(const transient::Domain& domain, const job::SimulationSpec& spec);

}  // namespace carillon::simulation
