// How a space is stepped.
#pragma once

#include "runtime/physics/joints/mechanism.hpp"

namespace carillon::rigid {

struct Options {
  double step_s = 2.5e-4;   // the longest small step where a curved surface may touch; flat ones take twice as long ones
  double tolerance = 1e-5;  // of gravity times the step: when the sweeps over the contacts end
  int max_sweeps = 30;
  int max_direct = 3;                           // bodies of a group whose problem is factorised in every step
  bool islands = true;                          // false: all bodies in one problem, for comparison
  int max_settling = 200;                       // the same of a group that is about to rest
  double rolling_resistance = 1e-3;             // c: couple c R F against rolling, of hard on hard
  double joint_tolerance = joints::kTolerance;  // of a step of a mechanism's free motion [rad, m]
};

}  // namespace carillon::rigid
