// Environment of child processes.
#pragma once

#include <string>
#include <vector>

namespace carillon::base {

/// True in a process that a launcher of MPI (mpirun, srun) started, and in its children; false in a job script of sbatch.
bool is_launched();

/// True for the process that prints for all ranks of its launcher; known before MPI_Init.
bool is_first_of_all();

/// In a process without a launcher: MPI starts without a daemon (a network and 0.15 s) and without a session folder (left behind after a
/// signal), unless the user's settings differ.
void isolate_lone_process();

/// The environment of this process, "NAME=value", without the variables of a launcher of MPI (mpirun, srun, prterun) for its ranks: the
/// child is no rank of its run. The user's own settings of MPI stay.
std::vector<std::string> make_environment();

/// The same for a solver of one rank: isolated, and without SLURM_ (0.2 s for a query of Slurm).
std::vector<std::string> make_lone_environment();

}  // namespace carillon::base
