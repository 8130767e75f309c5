// The checkpoint of a simulation: one sealed file.
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

/// Everything that changes.
struct SimulationState {
  std::vector<transient::EnergyBook> books;  // the same on every rank
  std::vector<std::byte> motion, contacts;   // rank 0
  std::vector<std::byte> sound;              // of this rank; empty without sound
};

/// Of the job's text, its meshes and the program: what a checkpoint is of. The same on any number of ranks. Local.
base::Sha256::Hash find_identity(const std::string& job_text, const transient::Assembly& assembly);

/// Writes the file whole or not at all, sealed by a hash of all that it has. Collective. Throws SystemError on every rank when the disk
/// refuses.
void save_checkpoint(const comm::Communicator& comm, const std::filesystem::path& file, const base::Sha256::Hash& identity,
                     const SimulationState& state);

/// Nothing where there is no file. Collective. Throws InputError on every rank for a file that is cut off or changed, and for that of
/// another identity or number of ranks.
std::optional<SimulationState> load_checkpoint(const comm::Communicator& comm, const std::filesystem::path& file,
                                               const base::Sha256::Hash& identity);

}  // namespace carillon::simulation
