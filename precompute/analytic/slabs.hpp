// Surfaces of thin flat bodies and of straight bodies.
#pragma once

#include <array>
#include <vector>

#include "precompute/analytic/known_body.hpp"

namespace carillon::analytic {

using Point2 = std::array<double, 2>;

/// Triangles in the plane, counter-clockwise.
struct Net {
  std::vector<Point2> points_m;
  std::vector<Triangle> triangles;
};

/// Rectangle from the origin, in columns by rows, each cell cut in two.
Net make_rectangle_net(double length_m, double width_m, int columns, int rows);
/// Disc about the origin: ring k of `rings` has 6 k points.
Net make_disc_net(double radius_m, int rings);

/// Both faces of a planar mesh at z = +-thickness / 2, and the rim between them.
ClosedSurface make_slab(const Net& net, double thickness_m);

/// Straight body along x from the origin: `section` is a convex polygon in (y, z), counter-clockwise seen from +x.
ClosedSurface make_prism(double length_m, const std::vector<Point2>& section, int intervals);

/// Mass, centre and inertia of a slab of uniform density, from the moments of the triangles.
bank::RigidBody calc_slab_rigid(const Net& net, double thickness_m, double mass_kg);

}  // namespace carillon::analytic
