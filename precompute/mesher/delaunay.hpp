// Delaunay refinement (CGAL Mesh_3) of a body between closed surfaces; std only, CGAL is confined to the .cpp files.
#pragma once

#include <memory>
#include <vector>

#include "precompute/mesh/tet_mesh.hpp"
#include "precompute/mesher/curve_sizes.hpp"
#include "precompute/mesher/distance_field.hpp"
#include "precompute/mesher/triangle_surface.hpp"

namespace carillon::mesher {

/// Size criteria, in metres.
struct DelaunaySizes {
  double edge_m = 0;          // approximate edge length
  double distance_m = 0;      // largest distance of a boundary face's centre from the true surface
  std::size_t max_nodes = 0;  // refinement stops at this count
};

/// A mesh under construction: refine() makes it for given sizes, optimise() removes its slivers.
class DelaunayBody {
 public:
  virtual ~DelaunayBody() = default;
  /// Refines from scratch. Returns the linear mesh with slivers; its boundary may touch itself at a few nodes. Throws std::runtime_error if
  /// curves or skins are too close together for refinement to end.
  virtual mesh::TetMesh refine(const DelaunaySizes& sizes) = 0;
  /// Exudes and perturbs the last refined mesh until few dihedral angles are under `angle_deg`; 0: no sliver removal.
  virtual mesh::TetMesh optimise(double angle_deg) = 0;
};

/// Body of calc_body(field, wall_m, .). `curves` lie on its boundary and become edges of the mesh. The field must outlive it.
std::unique_ptr<DelaunayBody> make_field_body(const DistanceField& field, double wall_m, const std::vector<Polyline>& curves);

/// Solid inside a closed surface without intersecting triangles; its faces are followed exactly.
std::unique_ptr<DelaunayBody> make_surface_body(const TriangleSurface& surface, const std::vector<Polyline>& curves);

}  // namespace carillon::mesher
