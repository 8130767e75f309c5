// Smooth surface through the corners of a triangle surface.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "precompute/mesher/triangle_surface.hpp"

namespace carillon::mesher {

/// Curved patches over the triangles of a surface: a faceted ball becomes round. Edges of the body stay (curved along themselves), planes
/// stay flat (classified by bends.hpp). Copies the facet data.
class RoundSurface {
 public:
  RoundSurface(TriangleSurface facets, double sharp_angle_deg);
  ~RoundSurface();
  RoundSurface(RoundSurface&&) noexcept;
  RoundSurface& operator=(RoundSurface&&) noexcept;

  /// Bulge of the patches over the edge midpoints [m]: maximum, and 95th percentile of the bulging ones.
  double get_largest_bulge() const;
  double get_usual_bulge() const;

  /// Switches to the flat facets, uncut, with the smooth surface as the alternative of find_doubt().
  void keep_facets();

  /// Enclosed volume [m^3]; for a smooth surface to about 1e-5 of the volume lost by the facets.
  double calc_volume() const;

  /// Triangulates the patches: each edge is cut into `pieces`, at most 16. Later calls of find() and find_doubt() refer to these triangles.
  TriangleSurface cut(int pieces);

  /// Facets; body edges with two facets (points, ascending); and the pieces of those and of the border in the last cut().
  const TriangleSurface& get_facets() const { return *facets_; }
  std::vector<std::array<std::int32_t, 2>> list_folds() const;
  std::vector<std::array<std::int32_t, 2>> list_lines() const;

  /// Surface point for a point on a triangle of the last cut().
  Vec3 find(std::int32_t triangle, const Vec3& p) const;

  /// True if some facets may be either planes or samples of a smooth surface.
  bool is_doubtful() const;
  /// Offset to the alternative surface: smooth where this one is flat and vice versa. Zero if unambiguous.
  Vec3 find_doubt(std::int32_t triangle, const Vec3& p) const;

 private:
  struct Patches;
  struct Place;
  Place find_place(std::int32_t triangle, const Vec3& p) const;

  std::unique_ptr<TriangleSurface> facets_;  // stable address: the patches refer to it
  std::unique_ptr<Patches> patches_, other_;
  int pieces_ = 1;
  bool keeps_facets_ = false;
};

}  // namespace carillon::mesher
