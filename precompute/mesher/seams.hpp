// Merges equal points and closes matching borders of a triangle soup.
#pragma once

#include <cstdint>

#include "precompute/mesher/triangle_surface.hpp"

namespace carillon::mesher {

/// Points closer than this part of the diagonal are equal: above single-precision rounding.
inline constexpr double kSamePoint = 1e-9;

/// Merges points closer than the tolerance (0: equal ones) and drops unused points.
void weld(TriangleSurface& surface, double tolerance);

/// Drops unused points. Returns their number.
std::int64_t drop_unused_points(TriangleSurface& surface);

/// Largest seam width over the diagonal. CAD programs tessellate faces separately; corners of a common edge then differ by up to about 1e-5
/// of the body.
inline constexpr double kSeam = 3e-5;

/// Joined seams.
struct Seams {
  std::int64_t edges = 0;  // borders closed
  double widest = 0.0;     // largest displacement of a point, in the surface's units
};

/// Joins matching borders within kSeam of the diagonal and a quarter of their length, nearest first; a corner inside the other side splits
/// it. Parallel sheets (a thin wall without rim) stay apart. Changes borders only; no change if none is closed.
Seams join_seams(TriangleSurface& surface);

/// Number of bodies among the parts of a surface: parts with a common point or an intersection count as one, a cavity wall as none.
std::int64_t count_bodies(TriangleSurface surface);

/// Surface of a file, without unused points, seams joined.
struct SurfaceInput {
  TriangleSurface surface;
  std::int64_t triangles = 0;      // of the file
  std::int64_t unused_points = 0;  // dropped
  Seams seams;
};
/// Throws InputError as read_surface().
SurfaceInput read_input(const std::filesystem::path& path);

}  // namespace carillon::mesher
