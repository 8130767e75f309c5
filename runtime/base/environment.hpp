// Environment of child processes.
#pragma once

#include <string>
#include <vector>

namespace carillon::base {

/// True in processes started by an MPI launcher (mpirun, srun) and their children; false in an sbatch script.
bool is_launched();

/// True for the rank that prints; available before MPI_Init.
bool is_first_of_all();

/// For a process without a launcher: MPI starts without daemon (network access, 0.15 s) and without session folder (left behind after a
/// signal), unless the user's settings differ.
void isolate_lone_process();

/// Environment of this process ("NAME=value") without per-rank variables of MPI launchers (mpirun, srun, prterun), so that a child is not
/// mistaken for a rank. The user's MPI settings stay.
std::vector<std::string> make_environment();

/// The same for a single-rank solver: isolated, and without SLURM_ (avoids a 0.2 s query of Slurm).
std::vector<std::string> make_lone_environment();

}  // namespace carillon::base
