// Distance from a point to the surface of a body, and the surface feature at the nearest point.
#pragma once

#include <algorithm>
#include <cmath>
#include <utility>

#include "runtime/physics/geometry/grid.hpp"
#include "runtime/physics/geometry/mesh.hpp"
#include "runtime/physics/geometry/polyhedron.hpp"
#include "runtime/physics/geometry/samples.hpp"
#include "runtime/physics/geometry/touch.hpp"

namespace carillon::geometry {

/// Gap of x over the skin [m], from the nearest point of the mesh; negative inside.
double calc_skin_gap(const Shape& shape, const Vec3& x, const Nearest& at, bool is_inside);

/// Distances from points to the surface of a body, in the body frame.
class SurfaceProbe {
 public:
  explicit SurfaceProbe(const Shape& shape) : shape_(shape), body_(shape.polyhedron()) {
    if (body_ != nullptr) return;
    grid_ = &shape.grid();
    const Mesh& mesh = shape.mesh();
    wall_m_ = 2.0 * mesh.volume_m3 / mesh.area_m2;
    thin_ = wall_m_ < kThinCells * grid_->get_cell_m();
  }

  /// Lower bound of the distance to the surface.
  double find_bound(const Vec3& x) const { return body_ != nullptr ? find_outside(x) : grid_->find_near(x).min_m; }
  /// Approximate signed distance, accurate enough to compare neighbours; a bound beyond `limit_m`.
  double estimate(const Vec3& x, double limit_m) const {
    if (body_ != nullptr) {
      int outside = 0;  // facets with x outside; two or more: x is next to an edge or a corner
      for (std::size_t i = 0; i < body_->normals.size() && outside < 2; ++i)
        outside += dot(body_->normals[i], x) > body_->offsets_m[i] ? 1 : 0;
      return outside < 2 ? find_outside(x) : std::sqrt(shape_.mesh().find_nearest(x, Box::kFar, -1).distance2);
    }
    const Grid::Near near = grid_->find_near(x);
    if (near.face < 0 || near.min_m > limit_m) return near.min_m;
    const auto [on, is_inside] = find_side(x, near.face);
    return (is_inside ? -1.0 : 1.0) * std::sqrt(on.distance2);
  }
  /// estimate(), but only a bound behind a thin wall.
  double find_distance(const Vec3& x, double limit_m) const { return thin_ ? find_bound(x) : estimate(x, limit_m); }
  bool is_thin() const { return thin_; }
  /// Gap over the skin; beyond `limit_m` a bound that also holds after movements shorter than the excess.
  double calc_gap(const Vec3& x, double limit_m) const {
    if (body_ != nullptr) return find_outside(x);
    const double sag = shape_.get_sag_m(), far = std::max(limit_m, 0.0) + sag;
    const Grid::Near near = grid_->find_near(x);
    if (near.face < 0) return near.min_m - sag;
    const auto [on, is_inside] = find_side(x, near.face);
    if (!is_inside && on.distance2 > far * far) return std::sqrt(on.distance2) - sag;
    const double gap = calc_skin_gap(shape_, x, on, is_inside);
    if (!is_inside || !(gap < limit_m)) return gap;
    // Inside, the walk may stop at an edge although another face is nearer: search all.
    const Nearest nearest = shape_.mesh().find_nearest(x, Box::kFar, on.face);
    return calc_skin_gap(shape_, x, nearest, shape_.mesh().is_inside(x, nearest));
  }
  Nearest find_nearest(const Vec3& x) const {
    const int face = body_ != nullptr ? -1 : grid_->find_near(x).face;
    return face >= 0 && !thin_ ? shape_.mesh().walk_nearest(x, face) : shape_.mesh().find_nearest(x, Box::kFar, face);
  }

 private:
  /// Nearest point, searched from a nearby face, and true for x inside.
  std::pair<Nearest, bool> find_side(const Vec3& x, int face) const {
    const Mesh& mesh = shape_.mesh();
    const Nearest on = mesh.walk_nearest(x, face);
    const bool is_inside = mesh.is_inside(x, on);
    if (!is_inside || !thin_ || on.distance2 <= 0.01 * wall_m_ * wall_m_) return {on, is_inside};
    const Nearest nearest = mesh.find_nearest(x, Box::kFar, on.face);  // x may be behind the far side of a wall
    return {nearest, mesh.is_inside(x, nearest)};
  }
  double find_outside(const Vec3& x) const {
    double max = -Box::kFar;
    for (std::size_t i = 0; i < body_->normals.size(); ++i) max = std::max(max, dot(body_->normals[i], x) - body_->offsets_m[i]);
    return max;
  }
  static constexpr double kThinCells = 4;  // cells; in thinner walls a grid node may refer to the far side

  const Shape& shape_;
  const Polyhedron* body_ = nullptr;
  const Grid* grid_ = nullptr;
  bool thin_ = false;
  double wall_m_ = 0.0;
};

/// Feature of a skin at a point: plane or curved part, edge or corner.
struct Facing {
  Side side = Side::plane;
  Vec3 axis{};  // normal of a plane, direction of a line
  int vertex = -1;
};
Facing describe(const Mesh& mesh, const Skin& skin, const Nearest& at);
/// Outward normal of a face at its point nearest to x; on a curved face the normal of the skin.
Vec3 find_normal(const Shape& shape, int face, const Vec3& x);
/// Ridge::into at a point of the ridge, in the tangent plane of a curved side.
Vec3 find_into(const Shape& shape, const Ridge& ridge, int side, const Vec3& x);

}  // namespace carillon::geometry
