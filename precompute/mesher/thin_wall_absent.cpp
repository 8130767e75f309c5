// Thin walls in a build without the component THIN_WALLS: sheets and the method "extrude" are refused, others go to the volume meshers.
#include "precompute/mesher/thin_wall.hpp"
#include "precompute/mesher/wall_error.hpp"
#include "runtime/base/component.hpp"

namespace carillon::mesher {

double find_thin_edge(const ThinBody& body, const SurfaceOptions& options) { return options.edge_m.value_or(8 * body.wall_m); }

mesh::TetMesh mesh_thin_wall(const ThinBody& body, const SurfaceOptions& options, SurfaceReport&, Phases&) {
  if (options.method == Method::kExtrusion || body.side != Side::kOutside)
    base::refuse_missing(options.surface.string() + ": an extruded wall", "THIN_WALLS");
  throw WallError("needs the component THIN_WALLS, of a build with -DCARILLON_THIN_WALLS=ON");
}

}  // namespace carillon::mesher
