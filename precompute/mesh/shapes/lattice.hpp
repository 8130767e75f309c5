// Building blocks of the parametric bodies (private to carillon::shapes).
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <vector>

#include "precompute/mesh/tet_mesh.hpp"

namespace carillon::shapes {

/// A Cartesian lattice of cells, cut into tetrahedra.
struct Lattice {
  std::array<int, 3> cells{1, 1, 1};
  int periodic_axis = -1;                             // the last point of this axis equals the first; needs an even number of cells
  std::function<bool(int, int, int)> keep = nullptr;  // selects cells; null keeps all
};

/// Lattice as a linear mesh: `place` maps a lattice point (i, j, k) to a position and must preserve orientation. Points of no kept cell get
/// no node. `indices`, if given, receives (i, j, k) of every node.
mesh::TetMesh make_lattice(const Lattice& lattice, const std::function<Vec3(int, int, int)>& place,
                           std::vector<std::array<int, 3>>* indices = nullptr);

/// Appends to `mesh` the three tetrahedra of the prism between the triangles `bottom` and `top` (outward of `bottom`). Quadrilaterals are
/// cut by the order of bottom's indices, so neighbouring prisms conform.
void append_prism(mesh::TetMesh& mesh, std::array<std::int32_t, 3> bottom, std::array<std::int32_t, 3> top);

/// Appends the refinement of a tetrahedron into frequency^3 ones; octahedra are cut along their shortest diagonal; the mesh already has the
/// nodes. `node` gives the node for the weights (a, b, c) of the base corners; the apex has the remaining weight. `skin`, if given,
/// receives the triangles of the base in its orientation.
void append_refined(mesh::TetMesh& mesh, int frequency, const std::function<std::int32_t(int, int, int)>& node,
                    std::vector<std::array<std::int32_t, 3>>* skin = nullptr);

/// Converts a linear mesh to a quadratic one. `place(a, b)` gives the mid-side node of the edge between corners a < b. A mid-side node
/// joins every named set that holds both edge ends.
void raise_order(mesh::TetMesh& mesh, const std::function<Vec3(std::int32_t, std::int32_t)>& place);

Vec3 calc_middle(const Vec3& a, const Vec3& b);

}  // namespace carillon::shapes
