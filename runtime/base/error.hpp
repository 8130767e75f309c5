// The three ways in which a Carillon program can fail, and the exit code of each.
#pragma once

#include <stdexcept>

namespace carillon {

/// The user's input cannot be used. The message names the file, the place in it and the remedy. Exit code 2.
class InputError : public std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// The numerics did not deliver what was asked for (a solve that lost modes, a factorisation that broke down). Exit code 3.
class SolveError : public std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// The machine refused (disk full, no memory, a file that cannot be written). Exit code 4.
class SystemError : public std::runtime_error {
  using std::runtime_error::runtime_error;
};

inline constexpr int kExitInput = 2;
inline constexpr int kExitSolve = 3;
inline constexpr int kExitSystem = 4;
inline constexpr int kExitCheckpointed = 85;  // stopped on request; the same command resumes from the checkpoint

}  // namespace carillon
