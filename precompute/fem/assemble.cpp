// Method: element matrices are added into rows of a known pattern (block_rows). Rigid-body data: sums of element moments about a common
//   point.
// Source: OSG02 section 3.2.
// Deviations: fixed nodes are eliminated (no row, no column) instead of penalised.
#include "precompute/fem/assemble.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <numeric>
#include <span>
#include <vector>

#include "precompute/fem/block_rows.hpp"
#include "precompute/fem/element.hpp"
#include "precompute/petsc/session.hpp"

namespace carillon::fem {
namespace {

using mesh::LocalMesh;

/// Node positions of tetrahedron e.
std::span<const Vec3> copy_positions(const LocalMesh& local, std::int32_t e, std::array<Vec3, kMaxNodes>& x) {
  const auto nodes = local.get_tet(e);
  for (std::size_t i = 0; i < nodes.size(); ++i) x[i] = local.nodes_m[nodes[i]];
  return {x.data(), nodes.size()};
}

/// Tetrahedra by the lowest row of their nodes, so that active rows stay in the cache for any order of the mesh file.
std::vector<std::int32_t> order_by_row(const LocalMesh& local) {
  std::vector<std::int32_t> lowest(local.tet_count()), order(local.tet_count());
  std::vector<std::int64_t> begin(local.nodes_m.size() + 1, 0);
  for (std::int32_t e = 0; e < local.tet_count(); ++e) {
    const auto nodes = local.get_tet(e);
    lowest[e] = *std::min_element(nodes.begin(), nodes.end());
    ++begin[lowest[e] + 1];
  }
  std::partial_sum(begin.begin(), begin.end(), begin.begin());
  for (std::int32_t e = 0; e < local.tet_count(); ++e) order[begin[lowest[e]]++] = e;
  return order;
}

[[noreturn]] void fail_element(const LocalMesh& local, std::int32_t e) {
  const std::int32_t node = local.get_tet(e)[0];
  const Vec3& x = local.nodes_m[node];
  // Numbers from 1, like the mesh check.
  throw InputError(
      fmt::format("element {} of the mesh (first node {} at {:.6g} {:.6g} {:.6g} m) is inside out or flat: its Jacobian is not "
                  "positive everywhere{}",
                  local.tet_in_mesh[e] + 1, local.node_in_mesh[node] + 1, x[0], x[1], x[2],
                  local.order == 1 ? "; remesh there"
                                   : "; a mid-side node lies too far from the middle of its edge: straighten that edge or "
                                     "remesh there with smaller elements"));
}

}  // namespace

System assemble(const comm::Communicator& comm, const LocalMesh& local, const Materials& materials, job::Mass mass, Form form) {
  LocalRows rows = make_rows(comm, local, mass == job::Mass::lumped);
  comm.agree([&] {
    std::vector<Solid> solids;
    for (const material::Material& material : materials.list) solids.emplace_back(material, form == Form::displacement);
    ElementMatrices element;
    std::array<Vec3, kMaxNodes> x;
    for (const std::int32_t e : order_by_row(local)) {
      if (!calc_element(copy_positions(local, e, x), solids[materials.find(e)], mass, element)) fail_element(local, e);
      rows.add(local.get_tet(e), local, element);
    }
  });
  finish(comm, rows);
  System system;
  system.stiffness = take_stiffness(comm, rows);
  system.mass = take_mass(comm, rows);
  return system;
}

RigidBody calc_rigid_body(const comm::Communicator& comm, const LocalMesh& local, const Materials& materials) {
  // Moments about the centre of the bounding box keep precision for a body far from the origin.
  Vec3 low, high, origin;
  low.fill(1e300);
  high.fill(-1e300);
  for (const Vec3& x : local.nodes_m)
    for (int k = 0; k < 3; ++k) {
      low[k] = std::min(low[k], x[k]);
      high[k] = std::max(high[k], x[k]);
    }
  comm.min(low);
  comm.max(high);
  for (int k = 0; k < 3; ++k) origin[k] = (low[k] + high[k]) / 2;

  std::array<double, 14> sum{};  // volume, mass, first moments, second moments
  for (std::int32_t e = 0; e < local.tet_count(); ++e) {
    std::array<Vec3, kMaxNodes> x;
    const auto nodes = copy_positions(local, e, x);
    for (Vec3& at : x)
      for (int k = 0; k < 3; ++k) at[k] -= origin[k];
    const ElementMoments moments = calc_moments(nodes, materials.list[materials.find(e)].density_kg_m3);
    sum[0] += moments.volume_m3;
    sum[1] += moments.mass_kg;
    for (int k = 0; k < 3; ++k) sum[2 + k] += moments.first_kg_m[k];
    for (int k = 0; k < 9; ++k) sum[5 + k] += moments.second_kg_m2[k];
  }
  comm.sum(sum);

  RigidBody body;
  body.volume_m3 = sum[0];
  body.mass_kg = sum[1];
  std::array<double, 9> second;  // integral rho x x^T about the centre of mass
  for (int r = 0; r < 3; ++r) {
    body.centre_m[r] = origin[r] + sum[2 + r] / sum[1];
    for (int c = 0; c < 3; ++c) second[3 * r + c] = sum[5 + 3 * r + c] - sum[2 + r] * sum[2 + c] / sum[1];
  }
  const double trace = second[0] + second[4] + second[8];
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c) body.inertia_kg_m2[3 * r + c] = (r == c ? trace : 0.0) - second[3 * r + c];
  return body;
}

}  // namespace carillon::fem
