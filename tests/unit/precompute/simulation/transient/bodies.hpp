// Common bodies of the tests.
#pragma once

#include <array>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "precompute/comm/communicator.hpp"
#include "precompute/mesh/shapes/shapes.hpp"
#include "precompute/simulation/transient/assembly.hpp"
#include "precompute/simulation/transient/domain.hpp"
#include "precompute/simulation/transient/motion.hpp"

namespace carillon::transient::testing {

inline Law make_law(double young_pa, double poisson, double density, double alpha1_s = 0.0) {
  Law law;
  law.mu_pa = young_pa / (2.0 * (1.0 + poisson));
  law.lambda_pa = young_pa * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson));
  law.phi_pa_s = alpha1_s * law.lambda_pa;
  law.psi_pa_s = alpha1_s * law.mu_pa;
  law.density_kg_m3 = density;
  return law;
}

/// Box from -edges / 2 to edges / 2. bend_m: largest displacement of mid nodes, consistent in all elements that share them.
inline mesh::TetMesh make_box(const std::array<double, 3>& edges_m, const std::array<int, 3>& cells, int order, double bend_m = 0.0) {
  mesh::TetMesh mesh = shapes::make_box(edges_m, cells, order);
  if (bend_m == 0.0) return mesh;
  std::vector<char> is_mid(mesh.nodes_m.size(), 0);
  for (std::int64_t e = 0; e < mesh.tet_count(); ++e)
    for (std::size_t a = 4; a < 10; ++a) is_mid[mesh.tet(e)[a]] = 1;
  for (std::size_t n = 0; n < mesh.nodes_m.size(); ++n) {
    if (is_mid[n] == 0) continue;
    Vec3& x = mesh.nodes_m[n];
    x = x + bend_m * Vec3{std::sin(71.0 * x[1] / edges_m[1] + 1.0), std::sin(53.0 * x[2] / edges_m[2] + 2.0),
                          std::cos(61.0 * x[0] / edges_m[0])};
  }
  return mesh;
}

/// Bodies on all ranks of a communicator, and their motion.
struct World {
  explicit World(std::vector<SolidBody> all_bodies, MPI_Comm communicator = MPI_COMM_WORLD)
      : comm(communicator),
        bodies(std::move(all_bodies)),
        assembly(std::make_shared<Assembly>(make_assembly(comm, bodies))),
        domain(comm, assembly) {}
  World(const World&) = delete;
  World& operator=(const World&) = delete;

  std::vector<std::int32_t> list_set(const std::string& set, std::size_t body = 0) const {
    std::vector<std::int32_t> nodes;
    for (const std::int32_t node : bodies[body].mesh.node_sets.at(set)) nodes.push_back(assembly->bodies[body].node_of_mesh[node]);
    return nodes;
  }
  double calc_mass() const {
    double mass = 0.0;
    for (const double one : domain.get_masses_kg()) mass += one;
    return comm.sum(mass);
  }

  comm::Communicator comm;
  std::vector<SolidBody> bodies;
  std::shared_ptr<const Assembly> assembly;
  Domain domain;
};

/// Number of the node nearest to a position.
inline std::int32_t find_node(const Assembly& assembly, const Vec3& place_m) {
  std::int32_t nearest = 0;
  for (std::int32_t n = 0; n < assembly.node_count(); ++n)
    if (norm(assembly.nodes_m[n] - place_m) < norm(assembly.nodes_m[nearest] - place_m)) nearest = n;
  return nearest;
}

/// Nodal value, on all ranks.
inline Vec3 find_value(const Domain& domain, const std::vector<Quad>& values, std::int32_t node) {
  const std::int32_t place = domain.find_place(node);
  std::array<double, 3> value{};
  if (place >= 0 && place < domain.own_count()) {
    const Quad& q = values[place];
    value = {q.x, q.y, q.z};
  }
  domain.get_comm().sum(std::span<double>(value));
  return value;
}

}  // namespace carillon::transient::testing
