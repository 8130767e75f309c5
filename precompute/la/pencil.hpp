// The scaled pencil (a K, b M).
#pragma once

#include <petscmat.h>

namespace carillon::la {

/// The pencil (a K, b M), a and b powers of two. K and M are not changed: code that reads their values multiplies them, which is exact, so
/// every number has the same bits as with scaled matrices. Refers to both matrices.
struct Pencil {
  Mat stiffness = nullptr;      // K, (3n, 3n) AIJ, symmetric, both triangles stored, whole nodes per rank
  Mat mass = nullptr;           // M, the same distribution
  double stiffness_factor = 1;  // a
  double mass_factor = 1;       // b
};

}  // namespace carillon::la
