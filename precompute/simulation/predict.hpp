// Cost prediction of a simulation.
#pragma once

#include <cstdint>
#include <string>

#include "precompute/comm/communicator.hpp"
#include "precompute/simulation/simulate.hpp"
#include "precompute/simulation/simulation.hpp"

namespace carillon::simulation {

/// From a few steps and sound samples. finer: nodes of the job over nodes of these meshes; program_bytes: memory before the bodies were
/// made. Collective.
std::string predict(const comm::Communicator& comm, Simulation& simulation, const SimulateOptions& options, double finer,
                    std::int64_t program_bytes);

}  // namespace carillon::simulation
