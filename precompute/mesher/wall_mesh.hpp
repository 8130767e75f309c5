// Bodies meshed as walls, by extrusion of their skins.
#pragma once

#include <optional>

#include "precompute/mesh/tet_mesh.hpp"
#include "precompute/mesher/phases.hpp"
#include "precompute/mesher/thin_wall.hpp"

namespace carillon::mesher {

/// Open sheet with a wall. Throws InputError if it cannot be extruded.
mesh::TetMesh make_sheet(Sheet sheet, const SurfaceOptions& options, SurfaceReport& report, Phases& phases);

/// Extruded wall of a closed body, if requested or thinner than the element length. Empty for bodies left to the volume meshers, with the
/// reason in the report. Throws InputError if extrusion was requested and is impossible.
std::optional<mesh::TetMesh> make_thin(const Body& body, const SurfaceOptions& options, SurfaceReport& report, Phases& phases);

}  // namespace carillon::mesher
