// The program carillon-precompute: one job to one mode bank.
#pragma once

#include <string>
#include <vector>

#include "precompute/petsc/session.hpp"

namespace carillon::run {

/// Executes a command line and returns the exit code; starts MPI, PETSc and SLEPc.
int run_program(int argc, char** argv);

/// After the start of MPI and PETSc: loads and allocates the common data of all runs, for forks of this process.
void prepare_forks();

/// run_program() in such a fork. Words after "--", options of PETSc, have no effect.
int run_program(const petsc::Session& session, std::vector<std::string> words);

}  // namespace carillon::run
