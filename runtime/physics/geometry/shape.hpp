// Collision geometry of a body, shared by all bodies of a bank.
//
// Three kinds of body, determined from the mesh: convex polyhedra of few facets (exact, independent of the fineness), smooth bodies and all
// others. Data of the last two kinds (samples, distance grid) is created on first use.
// [main-thread]
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>

#include "runtime/physics/geometry/vectors.hpp"

namespace carillon::geometry {

struct Nearest;
class Mesh;
class Skin;
struct Polyhedron;
class Samples;
class Grid;
class LowVertices;

/// A point of the input mesh: triangle, position in it, and mean curvature of the smooth body there (convex positive).
struct Place {
  std::int32_t triangle = 0;
  Vec3 barycentric{};
  double curvature_per_m = 0.0;
};

/// Collision geometry of one surface, shared by all bodies that use it. Logically constant; samples and grid are created on first use,
/// which only takes time.
class Shape {
 public:
  /// Throws InputError for a surface that is empty, open, non-manifold, degenerate or inside out; the message names the place.
  Shape(std::span<const Vec3> vertices_m, std::span<const std::array<std::int32_t, 3>> triangles);
  ~Shape();
  Shape(const Shape&) = delete;
  Shape& operator=(const Shape&) = delete;

  double get_size_m() const { return size_m_; }            // diagonal of the bounding box
  double get_thickness_m() const { return thickness_m_; }  // shortest side of the bounding box
  const Vec3& get_middle_m() const { return middle_m_; }   // of the bounding box
  double get_radius_m() const { return radius_m_; }        // of a ball about the middle that encloses the body
  /// Maximum distance between the curved surface and the mesh.
  double get_sag_m() const;
  /// Radius of the ball about `centre` (mesh frame) that encloses the body.
  double calc_radius_m(const Vec3& centre) const;
  /// Upper bound of the speed of any point due to a spin about `centre` (mesh frame).
  double calc_turning_speed(const Vec3& centre, const Vec3& spin) const;
  /// Upper bound of |way . (x - centre)| of any point x; mesh frame.
  double calc_reach_m(const Vec3& centre, const Vec3& way) const;
  /// Axis-aligned bounding box in the world frame.
  Box calc_box(const Frame& frame) const;
  /// Triangle of the input mesh at a surface point with normal `outward`; mesh frame. `hint`: a likely triangle, or -1.
  Place find_place(const Vec3& point_m, const Vec3& outward, std::int32_t hint = -1) const;
  /// Creates the data of ground searches, and of body searches if `meets_bodies`, so that the first search takes no longer than later ones.
  void prepare(bool meets_bodies = true) const;
  bool is_polyhedron() const { return polyhedron_ != nullptr; }
  /// Curvature assumed for a sharp corner; a ridge has half of it.
  double get_corner_curvature_per_m() const { return 200.0 / size_m_; }

  // Internal to this folder.
  const Mesh& mesh() const { return *mesh_; }
  const Skin& skin() const { return *skin_; }
  const Polyhedron* polyhedron() const { return polyhedron_.get(); }
  const Samples& samples() const;
  const Grid& grid() const;
  LowVertices& low_vertices() const;

 private:
  Place choose_face(const Nearest& on, const Vec3& point, const Vec3& outward) const;

  std::unique_ptr<const Mesh> mesh_;
  std::unique_ptr<const Skin> skin_;
  std::unique_ptr<const Polyhedron> polyhedron_;
  mutable std::unique_ptr<const Samples> samples_;
  mutable std::unique_ptr<const Grid> grid_;
  mutable std::unique_ptr<LowVertices> low_vertices_;
  Vec3 middle_m_{};
  double size_m_ = 0.0, thickness_m_ = 0.0, radius_m_ = 0.0;
};

}  // namespace carillon::geometry
