// Meshes partitioned by the separator tree of their nodes against METIS or bisection partitions, on any number of ranks.
#include "precompute/run/cut_mesh.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <numeric>
#include <string>

#include "precompute/comm/communicator.hpp"
#include "precompute/fem/assemble.hpp"
#include "precompute/ldlt/factor.hpp"
#include "precompute/ldlt/mesh_order.hpp"
#include "precompute/petsc/session.hpp"
#include "tests/support/box_mesh.hpp"
#include "tests/support/ranks.hpp"
#include "tests/unit/precompute/mesh/parallel/write_vtkhdf.hpp"

namespace carillon::run {
namespace {

using tests::get_rank;
using tests::get_ranks;
using Ints = std::vector<std::int32_t>;

/// A plate of T10 with unused nodes, and the nodes of its end, including complete elements.
mesh::TetMesh make_plate() {
  mesh::TetMesh plate = tests::make_box({16, 9, 2}, {0.16, 0.09, 0.02}, 2);
  for (int k = 0; k < 5; ++k) plate.nodes_m.push_back({9, 9, 9});
  return plate;
}

Ints find_end(const mesh::TetMesh& plate) {
  Ints nodes;
  for (std::size_t v = 0; v < plate.nodes_m.size(); ++v)
    if (plate.nodes_m[v][0] < 0.021) nodes.push_back(static_cast<std::int32_t>(v));
  return nodes;
}

fem::System assemble(const comm::Communicator& comm, const mesh::LocalMesh& local) {
  material::Material steel;
  steel.young_modulus_pa = 2e11;
  steel.poisson_ratio = 0.3;
  steel.density_kg_m3 = 7850;
  return fem::assemble(comm, local, steel, job::Mass::consistent);
}

/// Number of eigenvalues below sigma, with the backward error checked.
std::int64_t count_below(const fem::System& system, const ldlt::MeshOrder* order, double sigma) {
  ldlt::Factor factor({system.stiffness, system.mass}, order);
  EXPECT_TRUE(factor.factorise(sigma));
  EXPECT_LT(factor.get_backward_error(), 1e-12);
  return factor.get_negative_pivots();
}

void expect_whole(const comm::Communicator& comm, const mesh::DistributedMesh& cut, const mesh::DistributedMesh& other) {
  EXPECT_EQ(cut.nodes, other.nodes);
  EXPECT_EQ(cut.free_nodes, other.free_nodes);
  EXPECT_EQ(cut.components, other.components);
  const mesh::LocalMesh& local = cut.local;
  EXPECT_GT(local.tet_count(), 0);
  Ints tets = comm.all_gather(local.tet_in_mesh);
  std::sort(tets.begin(), tets.end());
  ASSERT_EQ(static_cast<std::int64_t>(tets.size()), other.tets);
  for (std::size_t e = 0; e < tets.size(); ++e) ASSERT_EQ(tets[e], static_cast<std::int32_t>(e)) << "each element is on one rank";
  const Ints rows = comm.all_gather(Ints(local.row.begin(), local.row.begin() + local.free_nodes));
  ASSERT_EQ(static_cast<std::int64_t>(rows.size()), cut.free_nodes);
  for (std::size_t v = 0; v < rows.size(); ++v) ASSERT_EQ(rows[v], static_cast<std::int32_t>(v)) << "rows follow the ranks";
}

TEST(CutByOrder, has_every_element_once_and_the_spectrum_of_the_other_cut) {
  const comm::Communicator comm(PETSC_COMM_WORLD);
  const mesh::TetMesh plate = get_rank() == 0 ? make_plate() : mesh::TetMesh();
  const Ints end = get_rank() == 0 ? find_end(plate) : Ints();
  for (const auto& [fixed, largest_ordered] : {std::pair(Ints(), 100'000), {end, 100'000}, {Ints(), 100}, {end, 100}}) {
    const CutMesh cut = cut_by_order(comm, plate, fixed, largest_ordered);
    const mesh::DistributedMesh metis = mesh::distribute(comm, plate, fixed);
    EXPECT_EQ(cut.order != nullptr, get_ranks() > 1);
    EXPECT_LE(cut.pieces.report.element_balance, 1.03);
    EXPECT_LE(cut.pieces.report.node_balance, 1.03);
    expect_whole(comm, cut.pieces, metis);
    const fem::System system = assemble(comm, cut.pieces.local);
    const fem::System other = assemble(comm, metis.local);
    for (const double omega : {2e4, 6e4, 2e5})
      EXPECT_EQ(count_below(system, cut.order.get(), omega * omega), count_below(other, nullptr, omega * omega)) << omega;
  }
}

TEST(CutByOrder, leaves_small_meshes_to_metis) {
  const comm::Communicator comm(PETSC_COMM_WORLD);
  const mesh::TetMesh box = get_rank() == 0 ? tests::make_box({2, 2, 2}, {1, 1, 1}) : mesh::TetMesh();
  const CutMesh cut = cut_by_order(comm, box, {});
  EXPECT_EQ(cut.order, nullptr);
  EXPECT_EQ(cut.pieces.free_nodes, 27);
}

TEST(RecutByOrder, cuts_what_all_ranks_read) {
  const comm::Communicator comm(PETSC_COMM_WORLD);
  const auto path =
      std::filesystem::temp_directory_path() / ("carillon-cut-mesh-" + std::to_string(comm.broadcast(int{getpid()})) + ".vtkhdf");
  if (get_rank() == 0) tests::write_vtkhdf(path, make_plate());
  MPI_Barrier(PETSC_COMM_WORLD);
  RecutByOrder recut(comm);
  const std::array<Vec3, 2> end{Vec3{-1, -1, -1}, Vec3{0.021, 1, 1}};
  const parallel_mesh::ReadOptions plain{.order = 2, .fixed = {{.box_m = end}}};
  parallel_mesh::ReadOptions options = plain;
  options.recut = recut.make_recut();
  const parallel_mesh::ParallelMesh read = parallel_mesh::read_parallel(comm, path, options);
  const parallel_mesh::ParallelMesh first = parallel_mesh::read_parallel(comm, path, plain);
  MPI_Barrier(PETSC_COMM_WORLD);
  if (get_rank() == 0) std::filesystem::remove(path);
  EXPECT_EQ(recut.get_order() != nullptr, get_ranks() > 1);
  EXPECT_LE(read.mesh.report.element_balance, 1.03);
  expect_whole(comm, read.mesh, first.mesh);
  EXPECT_EQ(read.fixed_nodes, first.fixed_nodes);
  EXPECT_EQ(read.boundary.triangles, first.boundary.triangles);
  const fem::System system = assemble(comm, read.mesh.local);
  const fem::System other = assemble(comm, first.mesh.local);
  EXPECT_EQ(count_below(system, recut.get_order().get(), 4e9), count_below(other, nullptr, 4e9));
}

}  // namespace
}  // namespace carillon::run
