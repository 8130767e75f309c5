// The environment of programs that this one starts.
#pragma once

#include <string>
#include <vector>

namespace carillon::base {

/// Has a launcher of MPI (mpirun, srun) started this process, or a program that did?
bool is_launched();

/// Whether this process prints for all that its launcher started; known before MPI has started.
bool is_first_of_all();

/// Has MPI start this process by itself, unless it was launched, or the user decided otherwise: without a daemon, which would need a
/// network and 0.15 s, and without a session folder, which would be left by a process that a signal ends.
void isolate_lone_process();

/// That of this process, "NAME=value", without what a launcher of MPI (mpirun, srun, prterun) has set for its ranks: a program that has it
/// is no rank of a run that this process may be in. What users set for MPI stays.
std::vector<std::string> make_environment();

/// The same for a solver of one rank: isolated, and without SLURM_, as asking Slurm takes MPI 0.2 s.
std::vector<std::string> make_lone_environment();

}  // namespace carillon::base
