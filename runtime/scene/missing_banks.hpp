// Banks of bodies that a scene describes instead of naming a bank.
#pragma once

#include "runtime/scene/scene.hpp"

namespace carillon::scene {

/// Sets the bank file of every body without one. `carillon bank-for`, a program of the precompute side, finds or computes it, once per
/// distinct description. Progress goes to standard error. Throws InputError with the place in the scene if it is refused or not installed,
/// SolveError and SystemError as reported.
void find_missing_banks(Scene& scene, bool is_quiet);

}  // namespace carillon::scene
