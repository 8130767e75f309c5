// Parametric bodies as well-shaped tetrahedral meshes, without a mesher: every body is a structured lattice that is mapped.
//
//   shapes::ShapeOptions options{.shape = "tube", .dimensions = {{"length", 0.4}, {"outer-radius", 0.0125}, {"wall", 0.001}}};
//   options.order = 2;
//   options.target_nodes = 20000;
//   mesh::TetMesh tube = shapes::make_shape(options);
//
// All lengths are metres, every body is centred on the origin (the bowl on the centre of its spheres). No MPI; thread-safe.
#pragma once

#include <array>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "precompute/mesh/tet_mesh.hpp"
#include "runtime/base/error.hpp"

namespace carillon::shapes {

/// One dimension of a shape: its name, what is taken when it is not given, and what it means.
struct Dimension {
  std::string name;
  double fallback = 0.0;  // 0 where the dimension is optional and means "none"
  std::string meaning;
};

/// One parametric body: its name, its dimensions and the node sets that its mesh carries.
struct Shape {
  std::string name;
  std::string summary;
  std::vector<Dimension> dimensions;
  std::vector<std::string> node_sets;
};

/// What to make. A dimension that is not given takes its fallback. Give `target_nodes` or `edge_m`, not both; neither means 10,000 nodes.
struct ShapeOptions {
  std::string shape;
  std::map<std::string, double> dimensions = {};  // by name, [m], angles in degrees
  int order = 1;                                  // 1 or 2
  std::optional<long long> target_nodes = {};     // all nodes of the mesh, mid-side nodes among them
  std::optional<double> edge_m = {};              // wanted length of an edge
};

/// All shapes: bar, tube, plate, sphere, bowl, box, hollow-box, cylinder, disc, ring, cone.
const std::vector<Shape>& get_shapes();

/// The shape called `name`. Throws InputError that names the nearest one.
const Shape& find_shape(std::string_view name);

/// Makes the mesh of a body. Elements are positively oriented, conforming and about as long as wide; walls get at least one layer of
/// quadratic or two layers of linear elements. The node count is the one next to `target_nodes` that the body's lattice can give, within
/// 10 % from 700 nodes on. Mid-side nodes of curved faces lie on the true surface.
/// Throws InputError: unknown shape or dimension (naming the nearest), a dimension that is not positive or finite, a wall that does not
/// fit, an order other than 1 or 2, a target that is out of reach.
mesh::TetMesh make_shape(const ShapeOptions& options);

/// A box with the given edges [m], centred on the origin, cut into divisions[0] x divisions[1] x divisions[2] cells of six tetrahedra
/// each, mirrored from cell to cell so that the mesh keeps the symmetry of an evenly divided box. Node sets "x-min" ... "z-max".
/// Throws InputError for edges that are not positive or divisions below 1.
mesh::TetMesh make_box(const std::array<double, 3>& edges_m, const std::array<int, 3>& divisions, int order = 1);

}  // namespace carillon::shapes
