// Sharp curves as the Delaunay mesher can take them.
#pragma once

#include <vector>

#include "precompute/mesher/triangle_surface.hpp"

namespace carillon::mesher {

/// The curves without repeated points, with ends closer than `same_m` made one, and without those that touch, cross or run along another
/// (or themselves) anywhere but at a common end: of two the shorter goes. A curve ends where it turns by more than a right angle. CGAL's
/// protecting balls shrink to nothing, or crash, on what is left out.
std::vector<Polyline> untangle_curves(std::vector<Polyline> curves, double same_m);

}  // namespace carillon::mesher
