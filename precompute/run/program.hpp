// The program carillon-precompute: one job to one mode bank.
#pragma once

#include <string>
#include <vector>

#include "precompute/petsc/session.hpp"

namespace carillon::run {

/// Executes a command line and returns the exit code; starts MPI, PETSc and SLEPc.
int run_program(int argc, char** argv);

/// In a process that has started them: loads, looks up and allocates what every run would, for its forks.
void prepare_forks();

/// The same as run_program() in a fork of such a process. Words after "--", options of PETSc, have no effect.
int run_program(const petsc::Session& session, std::vector<std::string> words);

}  // namespace carillon::run
