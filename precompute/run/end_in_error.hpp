// Exit of a failed program on several ranks.
#pragma once

#include <mpi.h>

#include <string>

#include "runtime/base/result.hpp"

namespace carillon::run {

/// Prints the error once, "PROGRAM: error: ...", writes it to `file` unless that is empty, and returns the exit code. Errors are agreed on
/// before they are thrown, so all ranks get here; a rank that gets here alone would leave the others waiting, so after a timeout it prints
/// the error itself and aborts all. `comm`: used for nothing else. Collective.
int end_in_error(MPI_Comm comm, const std::string& program, const std::string& file, const base::Result& result);

}  // namespace carillon::run
