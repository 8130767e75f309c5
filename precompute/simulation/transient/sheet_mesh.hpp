// Middle surface of a thin sheet: triangles with an angle per edge.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "runtime/base/triangle.hpp"
#include "runtime/base/vector.hpp"

namespace carillon::transient {

/// Triangles are counter-clockwise seen from the upper side.
struct SheetMesh {
  std::vector<Vec3> vertices_m;
  std::vector<Triangle> triangles;
  std::map<std::string, std::vector<std::int32_t>> node_sets;  // of vertices, ascending
};

/// Rectangle in the plane z = 0, centred on the origin: `cells` along the longer side, nearly square cells, each cut into two triangles,
/// mirrored from cell to cell. bow_m: rise of the middle line over the ends -x and +x, which stay at z = 0; a circular arc of chord
/// length_m. Node sets "x-min", "x-max", "y-min", "y-max", "rim". Throws InputError for dimensions that are not positive, fewer than two
/// cells, or a bow above 0.4 of the length.
SheetMesh make_rectangle(double length_m, double width_m, int cells, double bow_m = 0.0);

/// Disc in the plane z = 0 about the origin, `cells` along a diameter: rings of vertices, six more in each. Node sets "rim", "centre".
/// Throws InputError for a radius that is not positive or fewer than two cells.
SheetMesh make_disc(double radius_m, int cells);

/// Mesh in simulation numbering: nodes are vertices, then edges (angle in x), then ghosts: mirror images of the vertices opposite to
/// clamped edges, which fix the direction there.
struct SheetElements {
  std::int32_t vertices = 0, edges = 0, ghosts = 0;
  std::vector<Vec3> rest_m;                        // (nodes); of an edge: its midpoint
  std::vector<std::array<std::int32_t, 9>> nodes;  // (triangles) vertices 0 1 2; across the edge opposite to each of them, the vertex or
                                                   // ghost, -1: none; the nodes of those three edges
  std::vector<std::array<double, 3>> turn;         // (triangles) share of the dihedral angle: 1/2, 0 at the rim, 1 at a clamp
  std::vector<std::array<double, 3>> side;         // (triangles) sign of the edge's angle
  std::vector<std::array<std::int32_t, 2>> edge;   // (edges) its vertices
  std::int32_t count_nodes() const { return vertices + edges + ghosts; }
};

/// clamped: (vertices) clamped; a rim edge between two of them keeps its direction, and its angle must be fixed. Throws InputError for an
/// edge of more than two triangles, neighbours of opposite orientation, or a triangle without area.
SheetElements make_elements(const SheetMesh& mesh, const std::vector<bool>& clamped);

}  // namespace carillon::transient
