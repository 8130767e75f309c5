// Time stepping options of a space.
#pragma once

#include "runtime/physics/joints/mechanism.hpp"

namespace carillon::rigid {

struct Options {
  double step_s = 2.5e-4;   // maximum small step with curved contacts; flat ones use twice the length
  double tolerance = 1e-5;  // relative to gravity times the step: termination of the contact sweeps
  int max_sweeps = 30;
  int max_direct = 3;                           // maximum bodies of a group factorised in every step
  bool islands = true;                          // false: all bodies in one problem, for comparison
  int max_settling = 200;                       // the same for a group that is coming to rest
  double joint_tolerance = joints::kTolerance;  // per integration step of a mechanism's free motion [rad, m]
};

}  // namespace carillon::rigid
