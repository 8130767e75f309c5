// Output files of a simulation: sound, spectrogram, motion and record.
#pragma once

#include <string>

#include "precompute/comm/communicator.hpp"
#include "precompute/simulation/simulation.hpp"

namespace carillon::simulation {

/// Call after the last step; `seconds` of wall time for the record. Returns the terminal summary, on rank 0. Collective. Throws SystemError
/// on every rank for write errors.
std::string write_outputs(const comm::Communicator& comm, Simulation& simulation, double seconds);

}  // namespace carillon::simulation
