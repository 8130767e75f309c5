// One simulation, from job to sound, spectrogram, surface, motion and record.
#pragma once

#include <filesystem>
#include <string>

#include "precompute/comm/communicator.hpp"

namespace carillon::simulation {

struct SimulateOptions {
  bool quiet = false;
  std::filesystem::path progress;    // appended as JSON lines; empty: none
  std::filesystem::path checkpoint;  // resumed from if it exists, saved on signals and periodically; empty: none
  double checkpoint_every_s = 300;
  std::filesystem::path sound, spectrogram, surface, motion, record;  // override the job's; empty: the job's
  bool validate = false;                                              // predict only
  double patience_s = 9;  // time limit of a prediction; larger jobs are scaled from coarser meshes
  bool json = false;      // format of the prediction
};

/// Final output of main; on rank 0.
struct SimulateSummary {
  std::string result;       // energy book, peak, files
  bool is_stopped = false;  // by a signal, with a checkpoint
};

/// Reads the job on rank 0 and runs it on all ranks. Outputs are written atomically; writability is checked first. Bit-identical on any
/// number of ranks. Collective. Throws the same on every rank: InputError, SolveError (an inverted element, with position and time),
/// SystemError.
SimulateSummary simulate(const comm::Communicator& comm, const std::filesystem::path& job_file, const SimulateOptions& options);

}  // namespace carillon::simulation
