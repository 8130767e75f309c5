// Parametric bodies as well-shaped tetrahedral meshes: every body is a mapped structured lattice.
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

/// One dimension of a shape: name, default and meaning.
struct Dimension {
  std::string name;
  double fallback = 0.0;  // 0: optional, means "none"
  std::string meaning;
};

/// A parametric body: name, dimensions and node sets of its mesh.
struct Shape {
  std::string name;
  std::string summary;
  std::vector<Dimension> dimensions;
  std::vector<std::string> node_sets;
};

/// Shape to make. Missing dimensions take their fallback. At most one of `target_nodes` and `edge_m`; neither means 10,000 nodes.
struct ShapeOptions {
  std::string shape;
  std::map<std::string, double> dimensions = {};  // by name, [m], angles in degrees
  int order = 1;                                  // 1 or 2
  std::optional<long long> target_nodes = {};     // all nodes of the mesh, including mid-side nodes
  std::optional<double> edge_m = {};              // requested edge length
  int layers = 1;                                 // minimum through the least thickness, if the count permits
};

/// All shapes: bar, tube, plate, sphere, bowl, box, hollow-box, cylinder, disc, ring, cone.
const std::vector<Shape>& get_shapes();

/// Shape called `name`. Throws InputError that names the nearest one.
const Shape& find_shape(std::string_view name);

/// Makes the mesh of a body. Elements are positively oriented, conforming and nearly isotropic; walls get at least one layer of quadratic
/// or two layers of linear elements. The node count is the nearest that the lattice permits, within 10 % of `target_nodes` from 700 nodes
/// on. Mid-side nodes of curved faces lie on the true surface. Throws InputError: unknown shape or dimension (naming the nearest),
/// dimension not positive or finite, wall that does not fit, order other than 1 or 2, target out of reach.
mesh::TetMesh make_shape(const ShapeOptions& options);

/// Box with the given edges [m], centred on the origin, cut into divisions[0] x divisions[1] x divisions[2] cells of six tetrahedra,
/// mirrored from cell to cell to preserve the symmetry of an evenly divided box. Node sets "x-min" ... "z-max". Throws InputError for edges
/// that are not positive or divisions below 1.
mesh::TetMesh make_box(const std::array<double, 3>& edges_m, const std::array<int, 3>& divisions, int order = 1);

}  // namespace carillon::shapes
