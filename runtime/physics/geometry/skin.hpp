// Smooth body behind a faceted mesh: plane facets, ridges, and curved patches with normals by smoothing group.
//
// A patch is Phong tessellation with alpha 1/2: a quadratic Bezier triangle whose edges depend only on their two corners, so neighbours
// meet; a chord of a circle is raised to the arc to second order. Flat facets stay flat.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "runtime/physics/geometry/mesh.hpp"

namespace carillon::geometry {

/// Symmetric tensor: xx, yy, zz, xy, xz, yz.
using Tensor = std::array<double, 6>;
inline double calc_along(const Tensor& t, const Vec3& a, const Vec3& b) {
  return t[0] * a[0] * b[0] + t[1] * a[1] * b[1] + t[2] * a[2] * b[2] + t[3] * (a[0] * b[1] + a[1] * b[0]) +
         t[4] * (a[0] * b[2] + a[2] * b[0]) + t[5] * (a[1] * b[2] + a[2] * b[1]);
}
inline double calc_mean(const Tensor& t) { return 0.5 * (t[0] + t[1] + t[2]); }
/// Larger principal curvature of a tensor without curvature along the normal.
inline double calc_steepest(const Tensor& t) {
  const double mean = calc_mean(t), square = t[0] * t[0] + t[1] * t[1] + t[2] * t[2] + 2.0 * (t[3] * t[3] + t[4] * t[4] + t[5] * t[5]);
  return mean + std::sqrt(std::max(0.0, 0.5 * square - mean * mean));
}

struct Patch {
  std::array<Vec3, 3> p, c;  // corners; control point of the edge from corner k to the next
};

/// Point on the skin.
struct Spot {
  int face = -1;
  Vec3 weights{}, point{};
  double height = 0.0;  // along the requested direction, including the spring
  bool settled = true;  // false: left the reach before the lowest point was found
};

enum class VertexKind : std::uint8_t { none, smooth, ridge, corner };  // none: within a flat facet or a straight edge

/// Regions, sharp edges and curvatures of a mesh, which must outlive it. Immutable; neighbouring patches meet without a gap.
class Skin {
 public:
  explicit Skin(const Mesh& mesh);

  bool is_flat(int face) const { return flat_[face] != 0; }
  bool is_all_curved() const { return all_curved_; }
  /// Maximum distance between the curved skin and the mesh.
  double get_sag_m() const { return sag_m_; }
  int region(int face) const { return region_[face]; }
  int count_regions() const { return regions_; }
  bool is_sharp(int half_edge) const { return sharp_[half_edge] != 0; }
  VertexKind kind(int vertex) const { return kinds_[vertex]; }
  /// Radius of the rim through a ridge vertex [m]; 0: not on a rim.
  double calc_rim_radius_m(int vertex) const;
  /// A face at a vertex, preferably a curved one.
  int find_face(int vertex) const;
  /// Smoothing group of a face: faces joined over non-sharp edges.
  int group(int face) const { return group_[face]; }
  int count_smooth_edges() const { return smooth_edges_; }  // between different regions

  Patch get_patch(int face) const { return {{mesh_.corner(face, 0), mesh_.corner(face, 1), mesh_.corner(face, 2)}, bends_[face]}; }
  Vec3 calc_point(int face, const Vec3& w) const;
  /// Normal of the patch.
  Vec3 calc_normal(int face, const Vec3& w) const;
  /// Second fundamental form of the smooth body, convex positive [1/m].
  Tensor calc_tensor(int face, const Vec3& w) const;
  double calc_mean_curvature(int face, const Vec3& w) const;

  /// Walks from a face down to the lowest point along `up` on the curved skin, at most `reach` from `centre`. A weak spring to the centre
  /// prevents drift on level surfaces. On a rolling body the point lags by the ratio of the curvatures of spring and body, so the spring's
  /// is 0.001 over the size; 0.2 if the point `stays`.
  Spot walk_lowest(const Vec3& up, int face, const Vec3& centre, double reach, bool stays) const;
  /// Mesh point near x, by walking from a face, and its point on the curved skin.
  Spot locate(const Vec3& x, int face) const;

 private:
  void find_regions();
  void find_sharp_edges();
  void make_fans();
  void make_groups();
  bool is_tip(const std::vector<int>& corners, const Vec3& mean) const;  // corners: half-edges that leave a vertex
  void fit_tensor(int vertex, const std::vector<int>& corners, int fan);
  void make_bends();
  void lower(const Vec3& up, int face, const Vec3& centre, double spring, double below, Spot& spot) const;
  void place(Spot& spot) const;

  const Mesh& mesh_;
  bool all_curved_ = false;
  int regions_ = 0, smooth_edges_ = 0;
  std::vector<std::int32_t> region_, group_, fan_;  // of faces; of corners 3 f + k
  std::vector<double> region_area_;
  std::vector<char> sharp_, flat_, plane_;  // half-edges; faces; plane regions among curved ones
  std::vector<Vec3> fan_normals_;
  std::vector<Tensor> fan_tensors_;
  std::vector<char> fan_curved_;
  std::vector<std::array<Vec3, 3>> bends_;  // Patch::c of each face
  std::vector<VertexKind> kinds_;
  double sag_m_ = 0.0, tiny_ = 0.0, size_m_ = 0.0;
};

}  // namespace carillon::geometry
