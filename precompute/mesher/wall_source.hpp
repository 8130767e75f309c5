// Source surface of a thin wall's skin.
#pragma once

#include <vector>

#include "precompute/mesher/body.hpp"
#include "precompute/mesher/skin.hpp"

namespace carillon::mesher {

/// Triangles, folds and borders of a body's surface, and projections onto them. Invariant: no edge of three triangles, no point shared by
/// two parts. Refers to the body.
class WallSource {
 public:
  /// edge_m: of the skin; shorter isolated folds are noise. Throws WallError for a surface that branches or touches itself at a point.
  WallSource(const Body& body, const SurfaceOptions& options, double edge_m);

  const Skin& get_start() const { return start_; }
  const TriangleSurface& get_facets() const { return start_.surface; }
  std::size_t count_dropped_folds() const { return dropped_; }

  /// Nearest point of the smooth surface, or of the facets.
  Vec3 find(const Vec3& p) const;
  /// Nearest point of the folds and borders.
  Vec3 find_on_lines(const Vec3& p) const;
  double calc_distance(const Vec3& p) const { return norm(nearest_.find(p) - p); }

  /// As RoundSurface; zero without one.
  bool is_doubtful() const { return round_ && round_->is_doubtful(); }
  Vec3 find_doubt(const Vec3& p) const;

 private:
  struct Line {
    Vec3 a, way, middle;
    double square, half;
  };
  void find_lines(const TriangleSurface& surface, const std::vector<Edge>& folds);

  const RoundSurface* round_;
  NearestPoint nearest_;  // of the cut of round_, or of the facets
  Skin start_;
  std::vector<Line> lines_;
  std::size_t dropped_ = 0;
};

}  // namespace carillon::mesher
