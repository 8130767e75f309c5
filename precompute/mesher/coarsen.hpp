// A closed surface with fewer corners.
#pragma once

#include <cstddef>

#include "precompute/mesher/triangle_surface.hpp"

namespace carillon::mesher {

/// Collapses edges, the shortest first, until there are about `corners`; each new corner is where the volume and, next, the area change
/// least, so that the volume is kept to rounding. Triangles stay even, none becomes flat against its neighbours on purpose. Throws
/// InputError where the surface is no closed manifold, and for fewer than 12 corners. P. Lindstrom, G. Turk, IEEE Visualization (1998) 279.
TriangleSurface coarsen(const TriangleSurface& surface, std::size_t corners);

}  // namespace carillon::mesher
