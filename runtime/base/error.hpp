// Error classes of the programs, each with an exit code.
#pragma once

#include <stdexcept>

namespace carillon {

/// Invalid user input. The message names file, place and remedy. Exit code 2.
class InputError : public std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// Numerical failure (missing modes, breakdown of a factorisation). Exit code 3.
class SolveError : public std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// System failure (disk full, out of memory, write error). Exit code 4.
class SystemError : public std::runtime_error {
  using std::runtime_error::runtime_error;
};

inline constexpr int kExitInput = 2;
inline constexpr int kExitSolve = 3;
inline constexpr int kExitSystem = 4;
inline constexpr int kExitCheckpointed = 85;  // stopped on request; the same command resumes from the checkpoint

}  // namespace carillon
