// Thin walls in a build without the component THIN_WALLS: other bodies go to the volume meshers.
#include "precompute/mesher/wall_mesh.hpp"
#include "runtime/base/component.hpp"

namespace carillon::mesher {
namespace {

[[noreturn]] void refuse(const SurfaceOptions& options) {
  base::refuse_missing(options.surface.string() + ": an extruded wall", "THIN_WALLS");
}

}  // namespace

mesh::TetMesh make_sheet(Sheet, const SurfaceOptions& options, SurfaceReport&, Phases&) { refuse(options); }

std::optional<mesh::TetMesh> make_thin(const Body&, const SurfaceOptions& options, SurfaceReport&, Phases&) {
  if (options.method == Method::kExtrusion || (options.side != Side::kAutomatic && options.side != Side::kOutside)) refuse(options);
  return std::nullopt;
}

}  // namespace carillon::mesher
