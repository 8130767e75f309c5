// Volume meshes to files.
#pragma once

#include <filesystem>
#include <string>

#include "precompute/mesh/tet_mesh.hpp"

namespace carillon::mesh {

enum class GmshEncoding { kBinary, kText };

/// Writes Gmsh 4.1, first or second order, atomically. Each node set becomes a physical group of dimension 0 (one point element per node),
/// each region one of dimension 3 with its name (region 0: kNoRegionName), so that read_mesh restores the same mesh. A set equal to a
/// region's nodes is not written as points. Throws SystemError on write errors. Not collective.
void write_gmsh(const TetMesh& mesh, const std::filesystem::path& file, GmshEncoding encoding = GmshEncoding::kBinary);

/// The bytes of that file.
std::string make_gmsh(const TetMesh& mesh, GmshEncoding encoding = GmshEncoding::kBinary);

/// Writes VTU for ParaView and VTK, atomically: node sets as point arrays of 0 and 1, regions as the cell array "region" (without names),
/// as read_mesh reads them. Throws SystemError on write errors. Not collective.
void write_vtu(const TetMesh& mesh, const std::filesystem::path& file);

/// The bytes of that file.
std::string make_vtu(const TetMesh& mesh);

}  // namespace carillon::mesh
