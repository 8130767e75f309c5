// Mode-independent data of the estimate: gradients, patches of elements around vertices, surface shifts.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "precompute/comm/halo_exchange.hpp"
#include "precompute/fem/error_bars/error_bars.hpp"
#include "precompute/fem/error_bars/kernels.hpp"

namespace carillon::error_bars {

/// A patch belongs to a vertex and a material, since strains jump at interfaces. The patch of vertex place p and material m has number p *
/// materials + m, the recovered value of node n likewise n * materials + m.
struct Recovery {
  Elements elements;
  std::vector<std::int32_t> order;         // (e) the local element at each place of `elements`
  std::vector<std::int32_t> place;         // (nodes) place of a local node in the arrays of the estimate
  std::vector<std::int32_t> vertex_place;  // (nodes) place among the vertices, -1 for mid-side nodes
  std::vector<std::int32_t> vertex_node;   // (vertices) place among the nodes
  std::vector<Middle> middles;             // T10 only
  std::vector<std::int32_t> value_of;      // (e, n) place of the recovered value of an element's node
  std::vector<Shift> shifts, doubts;       // to the smooth surface; to the alternative surface
  std::vector<Traction> tractions;         // T10 with a consistent mass only
  comm::HaloExchange nodes, vertices;      // of values at places; at places among the vertices
  double one_layer = 0.0;                  // Level::one_layer
  bool is_guessed = false;                 // Level::is_guessed
  bool has_rims = false;                   // Level::has_rims
};

/// Collective. Throws InputError naming an element without volume or a material that is not positive definite, on all ranks alike.
Recovery make_recovery(const comm::Communicator& comm, const mesh::LocalMesh& local, std::span<const Solid> solids,
                       std::span<const std::int32_t> material_of_tet, job::Mass mass_kind);

}  // namespace carillon::error_bars
