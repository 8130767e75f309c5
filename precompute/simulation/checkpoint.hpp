// Checkpoint of a simulation: one sealed file.
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "precompute/comm/communicator.hpp"
#include "precompute/simulation/transient/motion.hpp"
#include "runtime/base/sha256.hpp"

namespace carillon::simulation {

/// Complete state.
struct SimulationState {
  std::vector<transient::EnergyBook> books;  // the same on every rank
  std::vector<std::byte> motion, contacts;   // rank 0
  std::vector<std::byte> sound;              // of this rank; empty without sound
};

/// Identity of a checkpoint: hash of the job's text, its meshes and the program version. Independent of the number of ranks. Local.
base::Sha256::Hash find_identity(const std::string& job_text, const transient::Assembly& assembly);

/// Writes the file atomically, sealed by a hash of its contents. Collective. Throws SystemError on every rank for write errors.
void save_checkpoint(const comm::Communicator& comm, const std::filesystem::path& file, const base::Sha256::Hash& identity,
                     const SimulationState& state);

/// Empty without a file. Collective. Throws InputError on every rank for a truncated or modified file, or another identity or number of
/// ranks.
std::optional<SimulationState> load_checkpoint(const comm::Communicator& comm, const std::filesystem::path& file,
                                               const base::Sha256::Hash& identity);

}  // namespace carillon::simulation
