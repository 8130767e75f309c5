// What the estimate knows of the mesh before it sees a mode: gradients, patches of elements around vertices, where the surface is off.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "precompute/comm/halo_exchange.hpp"
#include "precompute/fem/error_bars/error_bars.hpp"
#include "precompute/fem/error_bars/kernels.hpp"

namespace carillon::error_bars {

/// A patch belongs to a vertex and a material: strains of different materials are not averaged, as they jump at the interface. The patch of
/// vertex place p and material m has number p * materials + m, the recovered value of node n likewise n * materials + m.
struct Recovery {
  Elements elements;
  std::vector<std::int32_t> order;         // (e) the local element that `elements` has at each place
  std::vector<std::int32_t> place;         // (nodes) where the arrays of the estimate have a local node
  std::vector<std::int32_t> vertex_place;  // (nodes) place among the vertices, -1 for mid-side nodes
  std::vector<std::int32_t> vertex_node;   // (vertices) its place among the nodes
  std::vector<Middle> middles;             // T10 only
  std::vector<std::int32_t> value_of;      // (e, n) where the recovered value of an element's node is
  std::vector<Shift> shifts, doubts;       // to the smooth surface; to the surface that the body may have as well
  std::vector<Traction> tractions;         // T10 with a consistent mass only
  comm::HaloExchange nodes, vertices;      // of values at places; at places among the vertices
  double one_layer = 0.0;                  // Level::one_layer
};

/// Collective. Throws InputError naming an element without volume and a material that is not positive definite, on all ranks alike.
Recovery make_recovery(const comm::Communicator& comm, const mesh::LocalMesh& local, std::span<const Solid> solids,
                       std::span<const std::int32_t> material_of_tet, job::Mass mass_kind);

}  // namespace carillon::error_bars
