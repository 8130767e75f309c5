// Volume meshes from files: Gmsh, VTU, Medit, TetGen; linear and quadratic tetrahedra. Serial, no MPI.
//
//   mesh::TetMesh mesh = mesh::read_mesh("plate.msh");
//   mesh::CheckReport report = mesh::check_mesh(mesh);   // precompute/mesh/check.hpp: a read mesh is not yet a usable one
//
// Bytes are untrusted: whatever the file holds, the answer is a mesh or an InputError, never a crash, and never more memory than the file's
// size accounts for. What is not a tetrahedron: points, edges and surface elements only make node sets; hexahedra, prisms and pyramids are
// an error. Coordinates are taken as metres.
//
// Node sets by format (value 0 means "none" in all of them and makes no set; at most 1000 sets are made from one array of values):
//   Gmsh     every physical group of any dimension by its name, `physical:N` when it has none; groups of one name are joined
//   VTU      every integer point-data array with one component: `NAME` (values other than 0) and `NAME:N`
//   Medit    `ref:N` from the vertices' references, `edges:N` and `triangles:N` (and `quads:N`) from those of the surface elements
//   TetGen   `marker:N` from the boundary markers of the .node file
// Regions: Gmsh volume physical tag (of several, the first), Medit reference, TetGen region attribute, VTU integer cell array (the one
// named region, material, physical, ref or the like; else the only one).
#pragma once

#include <cstddef>
#include <filesystem>
#include <span>
#include <string>

#include "precompute/mesh/tet_mesh.hpp"

namespace carillon::mesh {

enum class MeshFormat { kGmsh, kVtu, kMedit, kTetgen };

/// Reads one mesh file; of a TetGen pair either file may be named. The format is found from the content, TetGen's from the extension.
/// Throws InputError "file:line: what is wrong; what would correct it" ("file: byte N:" in binary files), SystemError when the disk fails.
/// Not collective.
TetMesh read_mesh(const std::filesystem::path& file);

/// The same from memory; `name` is what messages call the file. kTetgen takes both files with one NUL byte between them: .node, NUL, .ele.
TetMesh parse_mesh(std::span<const std::byte> bytes, const std::string& name, MeshFormat format);

/// True if a cell array of VTK's formats of this name gives the regions: region, material, physical, ref or the like.
bool is_region_name(std::string name);

}  // namespace carillon::mesh
