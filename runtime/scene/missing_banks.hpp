// Banks of bodies that a scene describes in place of naming a bank.
#pragma once

#include "runtime/scene/scene.hpp"

namespace carillon::scene {

/// Gives every body without a bank the file of one. `carillon bank-for`, a program of the precompute side, finds or computes it, once for
/// bodies that are described alike. Its progress goes to standard error. Throws InputError with the place in the scene for what it refuses
/// and where it is not installed, SolveError and SystemError as it does.
void find_missing_banks(Scene& scene, bool is_quiet);

}  // namespace carillon::scene
