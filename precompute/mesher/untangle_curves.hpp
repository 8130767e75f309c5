// Prepares sharp curves for the Delaunay mesher.
#pragma once

#include <vector>

#include "precompute/mesher/triangle_surface.hpp"

namespace carillon::mesher {

/// Removes repeated points, merges ends closer than `same_m`, and drops curves that touch, cross or overlap another (or themselves) other
/// than at a common end: the shorter of two. Splits curves where they turn by more than a right angle. On the dropped curves CGAL's
/// protecting balls shrink to nothing, or CGAL crashes.
std::vector<Polyline> untangle_curves(std::vector<Polyline> curves, double same_m);

}  // namespace carillon::mesher
