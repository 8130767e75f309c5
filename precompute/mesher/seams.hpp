// Points and borders of a heap of triangles, joined where they are meant to be one.
#pragma once

#include <cstdint>

#include "precompute/mesher/triangle_surface.hpp"

namespace carillon::mesher {

/// Points closer than this part of the diagonal are one: coordinates in single precision differ by more.
inline constexpr double kSamePoint = 1e-9;

/// Joins points closer than the tolerance (0: equal ones) and drops points without a triangle.
void weld(TriangleSurface& surface, double tolerance);

/// Drops points that no triangle has. Returns how many.
std::int64_t drop_unused_points(TriangleSurface& surface);

/// Of the diagonal: borders closer than this are the two sides of a seam. CAD programs tessellate faces one by one, and then differ about
/// the corners of a common edge by up to about 1e-5 of the body.
inline constexpr double kSeam = 3e-5;

/// Seams that were joined.
struct Seams {
  std::int64_t edges = 0;  // borders that are none any more
  double widest = 0.0;     // farthest that one side was moved, in the surface's units
};

/// Joins borders that run along each other within kSeam of the diagonal and a quarter of their own length, the nearest first; a corner in
/// the middle of the other side cuts that in two. Two sheets that lie face to face (a thin wall without its rim) stay apart, and so does
/// everything that is no border. Nothing is changed where this closes no border.
Seams join_seams(TriangleSurface& surface);

/// How many bodies the parts of a surface are: those that share a point or cut through each other are one, and the wall of a cavity is
/// none.
std::int64_t count_bodies(TriangleSurface surface);

/// The surface of a file, as a body may be made of it: without points of no triangle, its seams joined.
struct SurfaceInput {
  TriangleSurface surface;
  std::int64_t triangles = 0;      // of the file
  std::int64_t unused_points = 0;  // that were dropped
  Seams seams;
};
/// Throws InputError as read_surface().
SurfaceInput read_input(const std::filesystem::path& path);

}  // namespace carillon::mesher
