// Joins equal points and matching borders of a triangle soup.
#pragma once

#include <cstdint>

#include "precompute/mesher/triangle_surface.hpp"

namespace carillon::mesher {

/// Points closer than this part of the diagonal are one: coordinates in single precision differ by more.
inline constexpr double kSamePoint = 1e-9;

/// Joins points closer than the tolerance (0: equal ones) and drops unused points.
void weld(TriangleSurface& surface, double tolerance);

/// Drops unused points. Returns their number.
std::int64_t drop_unused_points(TriangleSurface& surface);

/// Largest width of a seam over the diagonal. CAD programs tessellate faces one by one; the corners of a common edge then differ by up to
/// about 1e-5 of the body.
inline constexpr double kSeam = 3e-5;

/// Joined seams.
struct Seams {
  std::int64_t edges = 0;  // borders closed
  double widest = 0.0;     // largest displacement of a point, in the surface's units
};

/// Joins borders along each other within kSeam of the diagonal and a quarter of their own length, the nearest first; a corner inside the
/// other side cuts it in two. Parallel sheets (a thin wall without its rim) stay apart. Changes borders only, and nothing if no border is
/// closed.
Seams join_seams(TriangleSurface& surface);

/// Number of bodies among the parts of a surface: parts with a common point or an intersection are one body, the wall of a cavity is none.
std::int64_t count_bodies(TriangleSurface surface);

/// The surface of a file, without unused points, its seams joined.
struct SurfaceInput {
  TriangleSurface surface;
  std::int64_t triangles = 0;      // of the file
  std::int64_t unused_points = 0;  // dropped
  Seams seams;
};
/// Throws InputError as read_surface().
SurfaceInput read_input(const std::filesystem::path& path);

}  // namespace carillon::mesher
