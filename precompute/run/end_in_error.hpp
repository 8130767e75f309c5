// The end of a program of several ranks that failed.
#pragma once

#include <mpi.h>

#include <string>

#include "runtime/base/result.hpp"

namespace carillon::run {

/// Prints the error once, "PROGRAM: error: ...", writes it to `file` unless that is empty, and returns the exit code. Errors are agreed on
/// before they are thrown, so all ranks get here; should one get here alone, it would leave the others waiting for ever, so after a while
/// it prints the error itself and ends them all. `comm`: no other messages are on it. Collective.
int end_in_error(MPI_Comm comm, const std::string& program, const std::string& file, const base::Result& result);

}  // namespace carillon::run
