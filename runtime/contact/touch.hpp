// Which features of two surfaces are inside each other: vertices in faces and ridges across ridges.
#pragma once

#include <SimTKcommon.h>

#include <array>
#include <set>
#include <vector>

#include "runtime/contact/surface.hpp"

namespace carillon::contact {

/// One touching point of two bodies a and b (b = -1: the ground). The point is fixed on `carrier`, the plane on the other one.
struct TouchPoint {
  int a = 0, b = -1;
  std::array<int, 3> feature{};  // kind (0 vertex of a, 1 vertex of b, 2 ridges), index, index: tells the point again in the next step
  bool plane_on_b = true;        // the plane is fixed on b and the point on a, or the other way round
  SimTK::Vec3 station{0};        // of the point, frame of its body
  SimTK::Vec3 plane_point{0};    // of the plane, frame of the plane's body (world for the ground)
  SimTK::Vec3 plane_normal{0};   // outward of the plane's body, same frame
  // At the poses it was found with (world):
  SimTK::Vec3 where{0};
  SimTK::Vec3 normal{0};  // unit, from b to a
  double depth_m = 0.0;   // > 0 inside
};

/// Where the point of `touch` is, which way the normal (b to a) and how deep, at the poses given. X_b is not used for the ground's frame
/// other than as identity.
void place_touch(TouchPoint& touch, const SimTK::Transform& X_a, const SimTK::Transform& X_b);

/// The vertices of `surface` below the plane z = height_m that carry: those with no neighbour below themselves.
std::vector<TouchPoint> find_ground_touches(int a, const Surface& surface, const SimTK::Transform& X_a, double height_m);

/// The faces of two surfaces that are near each other, kept while the two hardly move against each other: what lies flush has thousands.
struct NearFaces {
  bool known = false;
  SimTK::Transform X_ba;  // of a in b when they were found
  std::set<int> faces_a, faces_b;
};

/// The carrying features of two surfaces that cut into each other; empty when they are apart. `near` is the caller's memory of this pair.
std::vector<TouchPoint> find_touches(int a, const Surface& surface_a, const SimTK::Transform& X_a, int b, const Surface& surface_b,
                                     const SimTK::Transform& X_b, NearFaces& near);

/// May the two surfaces come as near as `margin_m` to each other? By balls and boxes about them: true is a guess, false is sure.
bool may_be_near(const Surface& surface_a, const SimTK::Transform& X_a, const Surface& surface_b, const SimTK::Transform& X_b,
                 double margin_m);

/// How deep the two surfaces are in each other, whatever the features [m]; 0 when they are apart. `where` gets the deepest point (world).
double calc_overlap(const Surface& surface_a, const SimTK::Transform& X_a, const Surface& surface_b, const SimTK::Transform& X_b,
                    SimTK::Vec3& where);

}  // namespace carillon::contact
