// One simulation, from its job to sound, spectrogram, surface, motion and record.
#pragma once

#include <filesystem>
#include <string>

#include "precompute/comm/communicator.hpp"

namespace carillon::simulation {

struct SimulateOptions {
  bool quiet = false;
  std::filesystem::path progress;    // progress as JSON lines is appended here; empty: nowhere
  std::filesystem::path checkpoint;  // resumed from if it exists, saved to on signals and from time to time; empty: none
  double checkpoint_every_s = 300;
  std::filesystem::path sound, spectrogram, surface, motion, record;  // in place of the job's; empty: the job's
  bool validate = false;                                              // predict, do not simulate
  double patience_s = 9;                                              // of a prediction; larger jobs are scaled from coarser meshes
  bool json = false;                                                  // output of the prediction
};

/// What main prints at the end; on rank 0.
struct SimulateSummary {
  std::string result;       // energy book, peak, files
  bool is_stopped = false;  // by a signal, and there is a checkpoint
};

/// Reads the job on rank 0 and carries it out on all ranks. Outputs appear whole or not at all; whether they can be written is checked
/// before. The same bits on any number of ranks. Collective. Throws the same on every rank: InputError, SolveError (an element turned
/// inside out, with its place and time), SystemError.
SimulateSummary simulate(const comm::Communicator& comm, const std::filesystem::path& job_file, const SimulateOptions& options);

}  // namespace carillon::simulation
