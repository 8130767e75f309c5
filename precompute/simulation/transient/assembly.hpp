// All bodies of a run in one numbering, which does not depend on the number of ranks.
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

/// A solid body as a job has it, at rest where the run begins.
struct SolidBody {
  std::string name;    // in messages
  mesh::TetMesh mesh;  // of order 1 or 2, checked (mesh::check_mesh)
  Law law;
  double mass_damping_per_s = 0.0;  // alpha2
};

/// A thin sheet, likewise. Its nodes are its vertices, the angles of its edges, and ghosts (SheetElements).
struct SheetBody {
  std::string name;
  SheetMesh mesh;
  std::vector<bool> clamped;  // (vertices)
  SheetLaw law;
  double mass_damping_per_s = 0.0;
};
using AnyBody = std::variant<SolidBody, SheetBody>;

/// Bodies one behind the other. Within a body nodes follow a Morton curve through their rest positions; elements with straight edges come
/// first, then those with curved ones, each by their lowest node. These numbers give the order of every sum, and are what "node" and
/// "element" mean in this folder. The same on every rank.
struct Assembly {
  struct Body {
    std::string name;
    Law law;
    double mass_damping_per_s = 0.0;
    std::int32_t first_node = 0, last_node = 0;  // last: one behind
    std::int32_t first_element = 0, last_element = 0;
    std::int32_t first_curved = 0;           // element; last_element where none is
    std::size_t nodes_at = 0;                // in `tets`: of the first element
    int width = 4;                           // nodes of an element
    std::vector<std::int32_t> node_of_mesh;  // (nodes of the mesh) their numbers here
    bool is_sheet = false;
    SheetElements sheet;  // its numbers plus first_node are those here
    SheetLaw sheet_law;
  };
  std::vector<Body> bodies;
  std::vector<Vec3> nodes_m;                  // (N) at rest
  std::vector<std::int32_t> tets;             // nodes of all elements, body by body; of a sheet 9, -1 where there is none
  std::vector<std::int32_t> element_of_mesh;  // (E) number of the element in its body's mesh, from 0

  std::int32_t node_count() const { return static_cast<std::int32_t>(nodes_m.size()); }
  std::int32_t element_count() const { return static_cast<std::int32_t>(element_of_mesh.size()); }
  std::int32_t find_body_of_node(std::int32_t node) const;
  std::int32_t find_body(std::int32_t element) const;
  Kind find_kind(std::int32_t element) const;
  /// A node with a place in space, that gravity and rigid motion move: no angle of an edge, no ghost of a sheet.
  bool is_point(std::int32_t node) const;
  std::span<const std::int32_t> find_nodes(std::int32_t element) const;
  /// "body 'bar', element 12 of its mesh, whose centre is at rest at (0.1, 0.02, 0) m": for messages.
  std::string describe(std::int32_t element) const;
};

/// Bodies are read on rank 0 only. Collective. Throws on every rank: InputError for no body, a law that is no solid's (mu and density
/// positive, 3 lambda + 2 mu positive, phi and psi not negative), and an element whose Jacobian is not positive.
Assembly make_assembly(const comm::Communicator& comm, const std::vector<AnyBody>& bodies);
Assembly make_assembly(const comm::Communicator& comm, const std::vector<SolidBody>& bodies);

/// The facets of a body's skin in the numbers of the assembly: three corners, counter-clockwise seen from outside, then the mid nodes of
/// the edges 01, 12, 20 (-1 in linear meshes). Of a sheet its triangles. Ordered by element. Local.
std::vector<std::array<std::int32_t, 6>> list_skin(const Assembly& assembly, std::int32_t body);

/// A node that takes a share of a force.
struct NodeShare {
  std::int32_t node;
  double share;
};

/// Shares of a force at `point_m` (rest position) among the nodes of the nearest facet of the body's skin: the values of the facet's shape
/// functions at the nearest place on it, which sum up to 1. `distance_m`, if given: how far that is. Local.
std::vector<NodeShare> find_shares(const Assembly& assembly, std::span<const std::array<std::int32_t, 6>> skin, const Vec3& point_m,
                                   double* distance_m = nullptr);
/// The same with the skin listed for it.
std::vector<NodeShare> find_shares(const Assembly& assembly, std::int32_t body, const Vec3& point_m, double* distance_m = nullptr);

}  // namespace carillon::transient
