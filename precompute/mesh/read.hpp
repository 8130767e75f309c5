// Volume meshes from files: Gmsh, VTU, Medit, TetGen, CalculiX/Abaqus .inp, Nastran .bdf, UNV; linear and quadratic tetrahedra. Serial, no
// MPI.
//
//   mesh::TetMesh mesh = mesh::read_mesh("plate.msh");
//   mesh::CheckReport report = mesh::check_mesh(mesh);   // precompute/mesh/check.hpp: validates what was read
//
// Bytes are untrusted: the result is a mesh or an InputError, with memory in proportion to the file size. Points, edges and surface
// elements only define node sets; hexahedra, prisms and pyramids are an error. Coordinates are in the unit of the file, see
// scale_lengths().
//
// Node sets by format (value 0 means "none" and makes no set; at most 1000 sets per array of values):
//   Gmsh     every physical group of any dimension by its name, `physical:N` if unnamed; groups of equal names are merged
//   VTU      every integer point-data array with one component: `NAME` (values other than 0) and `NAME:N`, which
//            arrays of UInt8 that hold only 0 and 1 do not need
//   Medit    `ref:N` from the vertices' references, `edges:N` and `triangles:N` (and `quads:N`) from those of the surface elements
//   TetGen   `marker:N` from the boundary markers of the .node file
//   .inp     every *NSET and *ELSET; `*BOUNDARY`: the nodes that it holds in x, y and z (also mesh.supports)
//   Nastran  `SPC N` of each SPC or SPC1 set; `SPC`: the nodes that the set of the case control, or the only one, holds in x, y and z
//   UNV      every group
// Regions: .inp the element set of a *SOLID SECTION, Nastran the property, UNV the smallest group; Gmsh volume physical tag (the first of
// several), Medit reference, TetGen region attribute, VTU integer cell array (named region, material, physical, ref or similar; else the
// only one).
#pragma once

#include <cstddef>
#include <filesystem>
#include <span>
#include <string>

#include "precompute/mesh/tet_mesh.hpp"

namespace carillon::mesh {

enum class MeshFormat { kGmsh, kVtu, kMedit, kTetgen, kInp, kBdf, kUnv };

/// Reads one mesh file; for TetGen either file of the pair. The format is detected by content, TetGen's by extension. Throws InputError
/// "file:line: problem; remedy" ("file: byte N:" in binary files), SystemError on read errors. Not collective.
TetMesh read_mesh(const std::filesystem::path& file);

/// The same from memory; `name` is the file name in messages. kTetgen takes both files separated by one NUL byte: .node, NUL, .ele.
TetMesh parse_mesh(std::span<const std::byte> bytes, const std::string& name, MeshFormat format);

/// Turns lengths into metres: by the job's factor unless it is 1, else by the unit of the file. Returns the factor.
double scale_lengths(TetMesh& mesh, double metres_per_unit);

/// True if a VTK cell array of this name holds the regions: region, material, physical, ref or similar.
bool is_region_name(std::string name);

}  // namespace carillon::mesh
