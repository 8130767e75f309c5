// Jobs that --validate cannot prepare in time, made coarser.
#pragma once

#include "precompute/job/simulation.hpp"

namespace carillon::simulate {

/// Gives shapes and surfaces that would take longer than `seconds` to mesh and prepare as many nodes as that allows, and returns how many
/// times as many they were to have; 1: nothing was changed. Throws InputError for a mesh file that is too large, which has no coarser form.
/// Not collective.
double coarsen(job::SimulationSpec& spec, double seconds);

}  // namespace carillon::simulate
