// All bodies of a run in one numbering, independent of the number of ranks.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "precompute/comm/communicator.hpp"
#include "precompute/mesh/tet_mesh.hpp"
#include "precompute/simulation/transient/element.hpp"
#include "precompute/simulation/transient/quad.hpp"
#include "precompute/simulation/transient/sheet_mesh.hpp"
#include "precompute/simulation/transient/sheets.hpp"

namespace carillon::transient {

/// Solid body of a job, in its initial position.
struct SolidBody {
  std::string name;    // in messages
  mesh::TetMesh mesh;  // of order 1 or 2, checked (mesh::check_mesh)
  Law law;
  double mass_damping_per_s = 0.0;  // alpha2
};

/// Thin sheet, likewise. Nodes: vertices, edge angles, and ghosts (SheetElements).
struct SheetBody {
  std::string name;
  SheetMesh mesh;
  std::vector<bool> clamped;  // (vertices)
  SheetLaw law;
  double mass_damping_per_s = 0.0;
};
using AnyBody = std::variant<SolidBody, SheetBody>;

/// Concatenated bodies. Within a body nodes follow a Morton curve through their rest positions; straight elements precede curved ones, each
/// sorted by lowest node. These numbers define the order of every sum, and the meaning of "node" and "element" in this folder. The same on
/// every rank.
struct Assembly {
  struct Body {
    std::string name;
    Law law;
    double mass_damping_per_s = 0.0;
    std::int32_t first_node = 0, last_node = 0;  // last: one past the end
    std::int32_t first_element = 0, last_element = 0;
    std::int32_t first_curved = 0;           // first curved element; last_element if none
    std::size_t nodes_at = 0;                // in `tets`: of the first element
    int width = 4;                           // nodes per element
    std::vector<std::int32_t> node_of_mesh;  // (nodes of the mesh) assembly numbers
    bool is_sheet = false;
    SheetElements sheet;  // plus first_node: assembly numbers
    SheetLaw sheet_law;
  };
  std::vector<Body> bodies;
  std::vector<Vec3> nodes_m;                  // (N) at rest
  std::vector<std::int32_t> tets;             // nodes of all elements, by body; of a sheet 9, -1 for none
  std::vector<std::int32_t> element_of_mesh;  // (E) element number in its body's mesh, from 0

  std::int32_t node_count() const { return static_cast<std::int32_t>(nodes_m.size()); }
  std::int32_t element_count() const { return static_cast<std::int32_t>(element_of_mesh.size()); }
  std::int32_t find_body_of_node(std::int32_t node) const;
  std::int32_t find_body(std::int32_t element) const;
  Kind find_kind(std::int32_t element) const;
  /// True for nodes with a position, subject to gravity and rigid motion; false for edge angles and ghosts of sheets.
  bool is_point(std::int32_t node) const;
  std::span<const std::int32_t> find_nodes(std::int32_t element) const;
  /// "body 'bar', element 12 of its mesh, whose centre is at rest at (0.1, 0.02, 0) m": for messages.
  std::string describe(std::int32_t element) const;
};

/// Bodies are read on rank 0 only. Collective. Throws on every rank: InputError for no body, an invalid law (mu, density and 3 lambda + 2
/// mu must be positive, phi and psi not negative), or an element with a nonpositive Jacobian.
Assembly make_assembly(const comm::Communicator& comm, const std::vector<AnyBody>& bodies);
Assembly make_assembly(const comm::Communicator& comm, const std::vector<SolidBody>& bodies);

/// Skin facets of a body in assembly numbers: three corners, counter-clockwise seen from outside, then the mid nodes of edges 01, 12, 20
/// (-1 in linear meshes). For a sheet its triangles. Ordered by element. Local.
std::vector<std::array<std::int32_t, 6>> list_skin(const Assembly& assembly, std::int32_t body);

/// A node and its share of a force.
struct NodeShare {
  std::int32_t node;
  double share;
};

/// Shares of a force at `point_m` (rest position) among the nodes of the nearest skin facet: its shape functions at the nearest point,
/// which sum to 1. `distance_m`, if given: distance to that point. Local.
std::vector<NodeShare> find_shares(const Assembly& assembly, std::span<const std::array<std::int32_t, 6>> skin, const Vec3& point_m,
                                   double* distance_m = nullptr);
/// The same for a given list of skin facets.
std::vector<NodeShare> find_shares(const Assembly& assembly, std::int32_t body, const Vec3& point_m, double* distance_m = nullptr);

}  // namespace carillon::transient
