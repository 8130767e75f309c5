// Coarser meshes for --validate, to bound its time on large jobs.
#pragma once

#include "precompute/job/simulation.hpp"

namespace carillon::simulation {

/// Reduces the nodes of shapes and surfaces so that meshing and preparation take `seconds`. Returns the largest ratio of nodes before to
/// after; 1: unchanged. Throws InputError for a mesh file too large to read in time. Not collective.
double coarsen(job::SimulationSpec& spec, double seconds);

}  // namespace carillon::simulation
