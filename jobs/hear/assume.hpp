// What an object is taken for that comes without size and wall.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "jobs/hear/hear.hpp"

namespace carillon::hear {

/// What `carillon-mesh --look` says of a surface or a mesh.
struct SurfaceFacts {
  bool is_mesh = false;  // of tetrahedra: extent is all that is known
  long long triangles = 0, parts = 0, openings = 0;
  std::array<double, 3> extent{};  // in the file's units
  double thickness = 0.0;          // of a surface that is both sides of a wall, in the file's units
};

/// Metres per unit of the file: as asked for, else guessed from the numbers; what was guessed is said in `assumed`. `height_m` is taken
/// before the rest. Throws InputError where no unit makes sense.
double find_scale(const Order& options, const SurfaceFacts& look, double height_m, std::vector<std::string>& assumed);

/// Throws InputError where the wall that is asked for, or its absence, cannot be: an open surface without one, one thicker than the body.
void check_wall(const Order& options, const SurfaceFacts& look, double scale);

}  // namespace carillon::hear
