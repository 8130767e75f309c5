// The smooth surface through the corners of a triangle surface.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "precompute/mesher/triangle_surface.hpp"

namespace carillon::mesher {

/// Curved patches over the triangles of a surface: a faceted ball is a ball again. Edges of the body stay edges (curved along themselves),
/// planes stay flat: bends.hpp says which. Keeps what it needs of the facets.
class RoundSurface {
 public:
  RoundSurface(TriangleSurface facets, double sharp_angle_deg);
  ~RoundSurface();
  RoundSurface(RoundSurface&&) noexcept;
  RoundSurface& operator=(RoundSurface&&) noexcept;

  /// How far the patches bulge over the middles of the edges [m]: the largest, and the one that 95 % of those that bulge at all stay under.
  double get_largest_bulge() const;
  double get_usual_bulge() const;

  /// From now on the surface is that of the facets themselves, uncut, and the smooth one is as likely: find_doubt() leads to it.
  void keep_facets();

  /// The volume that the surface encloses [m^3]; of a smooth one to about 1e-5 of what the facets lack of it.
  double calc_volume() const;

  /// A triangle surface on the patches: each edge is cut into `pieces`, at most 16. It stands for this surface from now on, and its
  /// triangles for the arguments of find() and find_doubt().
  TriangleSurface cut(int pieces);

  /// The facets themselves; their edges (points, ascending) that are edges of the body and have two facets; and the pieces of those and of
  /// the border in the last cut().
  const TriangleSurface& get_facets() const { return *facets_; }
  std::vector<std::array<std::int32_t, 2>> list_folds() const;
  std::vector<std::array<std::int32_t, 2>> list_lines() const;

  /// The point of the surface that belongs to a point of a triangle of the last cut().
  Vec3 find(std::int32_t triangle, const Vec3& p) const;

  /// True if the facets leave open, somewhere, whether they are planes or samples of a smooth surface.
  bool is_doubtful() const;
  /// From the point of the surface to that of the surface that is as likely: smooth where this one is flat and the other way round.
  /// Zero where there is no doubt.
  Vec3 find_doubt(std::int32_t triangle, const Vec3& p) const;

 private:
  struct Patches;
  struct Place;
  Place find_place(std::int32_t triangle, const Vec3& p) const;

  std::unique_ptr<TriangleSurface> facets_;  // at one place: the patches refer to it
  std::unique_ptr<Patches> patches_, other_;
  int pieces_ = 1;
  bool keeps_facets_ = false;
};

}  // namespace carillon::mesher
