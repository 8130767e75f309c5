// Assumptions about an object without a given size and wall.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "jobs/front/hear/hear.hpp"

namespace carillon::hear {

/// The output of `carillon-mesh --look` for a surface or a mesh.
struct SurfaceFacts {
  bool is_mesh = false;  // tetrahedra; only the extent is known
  double unit_m = 1.0;   // of a mesh file that names it
  std::string unit;      // the reason; empty: metres by convention
  long long triangles = 0, parts = 0, openings = 0;
  std::array<double, 3> extent{};  // in the file's units
  double thickness = 0.0;          // of a surface with both sides of a wall, in the file's units; 0: none
};

/// Metres per unit of the file: as given (`height_m` takes precedence), else guessed from the extent and added to `assumed`. InputError if
/// no unit gives a plausible size.
double find_scale(const Order& options, const SurfaceFacts& look, double height_m, std::vector<std::string>& assumed);

/// InputError for an open surface without a wall, and for a wall too thick or too thin for the body.
void check_wall(const Order& options, const SurfaceFacts& look, double scale);

}  // namespace carillon::hear
