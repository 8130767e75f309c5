// Coarser meshes for --validate, to prepare large jobs in time.
#pragma once

#include "precompute/job/simulation.hpp"

namespace carillon::simulation {

/// Reduces the nodes of shapes and surfaces to those that can be meshed and prepared in `seconds`. Returns the largest ratio of nodes
/// before to after; 1: unchanged. Throws InputError for a mesh file too large to read in time. Not collective.
double coarsen(job::SimulationSpec& spec, double seconds);

}  // namespace carillon::simulation
