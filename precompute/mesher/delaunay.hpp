// Delaunay refinement (CGAL Mesh_3) of a body between closed surfaces; std only, CGAL stays in the .cpp files.
#pragma once

#include <memory>
#include <vector>

#include "precompute/mesh/tet_mesh.hpp"
#include "precompute/mesher/curve_sizes.hpp"
#include "precompute/mesher/distance_field.hpp"
#include "precompute/mesher/triangle_surface.hpp"

namespace carillon::mesher {

/// What the elements must satisfy, in metres.
struct DelaunaySizes {
  double edge_m = 0;          // about the length of the edges
  double distance_m = 0;      // farthest that a boundary face's middle may lie from the true surface
  std::size_t max_nodes = 0;  // refinement stops there with whatever it has
};

/// One mesh in the making: refine makes it again for given sizes, optimise removes its slivers.
class DelaunayBody {
 public:
  virtual ~DelaunayBody() = default;
  /// Refines from the start. Returns the mesh as it is then, with slivers; linear, and its boundary may touch itself at a few nodes. Throws
  /// std::runtime_error if curves or skins lie so close to each other that it would not end.
  virtual mesh::TetMesh refine(const DelaunaySizes& sizes) = 0;
  /// Exudes and perturbs the last refined mesh until few dihedral angles are under `angle_deg`; 0: leaves them as they are.
  virtual mesh::TetMesh optimise(double angle_deg) = 0;
};

/// The body of calc_body(field, wall_m, .). `curves` lie on its boundary and become edges of the mesh. The field must outlive it.
std::unique_ptr<DelaunayBody> make_field_body(const DistanceField& field, double wall_m, const std::vector<Polyline>& curves);

/// The solid inside a closed surface whose triangles do not intersect; its faces are followed exactly.
std::unique_ptr<DelaunayBody> make_surface_body(const TriangleSurface& surface, const std::vector<Polyline>& curves);

}  // namespace carillon::mesher
