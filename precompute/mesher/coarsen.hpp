// A closed surface with fewer corners.
#pragma once

#include <cstddef>

#include "precompute/mesher/triangle_surface.hpp"

namespace carillon::mesher {

/// Collapses edges, shortest first, down to about `corners`; each new corner minimises the change of volume, then of area, so that the
/// volume is kept to rounding. Triangles stay even, also on flat faces. Throws InputError unless the surface is a closed manifold, and for
/// fewer than 12 corners. P. Lindstrom, G. Turk, IEEE Visualization (1998) 279.
TriangleSurface coarsen(const TriangleSurface& surface, std::size_t corners);

}  // namespace carillon::mesher
