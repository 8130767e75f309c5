// Parallel reader against the serial path: numbering, boundary, fixed nodes and refusals.
#include "precompute/mesh/parallel/read_parallel.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <functional>
#include <map>
#include <numeric>
#include <random>
#include <set>

#include "precompute/mesh/shapes/shapes.hpp"
#include "precompute/petsc/session.hpp"
#include "runtime/base/error.hpp"
#include "tests/support/box_mesh.hpp"
#include "tests/support/catch_message.hpp"
#include "tests/support/ranks.hpp"
#include "tests/unit/precompute/mesh/parallel/write_vtkhdf.hpp"

namespace carillon::parallel_mesh {
namespace {

using testing::HasSubstr;
using tests::get_rank;
using tests::get_ranks;
using Box = std::array<Vec3, 2>;

const MPI_Comm kWorld = MPI_COMM_WORLD;

/// File written by rank 0 and read by all.
class SharedFile {
 public:
  SharedFile(const mesh::TetMesh& mesh, const tests::VtkHdfOptions& options = {}) {
    int id = getpid();
    MPI_Bcast(&id, 1, MPI_INT, 0, kWorld);
    path_ = std::filesystem::temp_directory_path() / ("carillon-parallel-mesh-" + std::to_string(id) + ".vtkhdf");
    if (get_rank() == 0) tests::write_vtkhdf(path_, mesh, options);
    MPI_Barrier(kWorld);
  }
  ~SharedFile() {
    MPI_Barrier(kWorld);
    if (get_rank() == 0) std::filesystem::remove(path_);
  }
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

/// A tube with shuffled elements and nodes, some elements inverted, some nodes unused.
mesh::TetMesh make_shuffled_tube(int order) {
  mesh::TetMesh tube = tests::make_box({9, 5, 4}, {0.9, 0.5, 0.4}, order);
  std::mt19937 random(3);
  const std::size_t width = static_cast<std::size_t>(tube.nodes_per_tet()), count = tube.tet_count();
  mesh::TetMesh mixed;
  mixed.order = order;
  for (int k = 0; k < 7; ++k) tube.nodes_m.push_back({9.0 + k, 9, 9});
  std::vector<std::int32_t> place(tube.nodes_m.size()), elements(count);
  std::iota(place.begin(), place.end(), 0);
  std::shuffle(place.begin(), place.end(), random);
  mixed.nodes_m.resize(tube.nodes_m.size());
  for (std::size_t i = 0; i < place.size(); ++i) mixed.nodes_m[place[i]] = tube.nodes_m[i];
  std::iota(elements.begin(), elements.end(), 0);
  std::shuffle(elements.begin(), elements.end(), random);
  for (const auto e : elements) {
    std::vector<std::int32_t> tet;
    for (std::size_t i = 0; i < width; ++i) tet.push_back(place[tube.tets[static_cast<std::size_t>(e) * width + i]]);
    if (e % 5 == 0) {
      std::swap(tet[1], tet[2]);
      if (order == 2) {
        std::swap(tet[4], tet[6]);
        std::swap(tet[8], tet[9]);
      }
    }
    mixed.tets.insert(mixed.tets.end(), tet.begin(), tet.end());
    mixed.regions.push_back(e % 3 - 1);
  }
  return mixed;
}

/// Mesh of the serial path.
struct Truth {
  mesh::TetMesh mesh;
  mesh::CheckReport check;
  mesh::Surface surface;
};

Truth make_truth(mesh::TetMesh mesh, int order) {
  Truth truth;
  truth.check = mesh::check_mesh(mesh);
  truth.mesh = order == 2 ? mesh::to_quadratic(mesh) : mesh::to_linear(mesh);
  truth.surface = mesh::extract_boundary(truth.mesh);
  return truth;
}

class Orders : public testing::TestWithParam<std::pair<int, int>> {};  // order in the file, requested order

TEST_P(Orders, same_mesh_as_serial) {
  const auto [file_order, order] = GetParam();
  const mesh::TetMesh mesh = make_shuffled_tube(file_order);
  const SharedFile file(mesh);
  const Truth truth = make_truth(mesh, order);
  const ParallelMesh read = read_parallel(kWorld, file.path(), {.order = order});
  const mesh::LocalMesh& local = read.mesh.local;
  EXPECT_EQ(read.mesh.nodes, static_cast<std::int64_t>(truth.mesh.nodes_m.size()));
  EXPECT_EQ(read.mesh.tets, truth.mesh.tet_count());
  EXPECT_EQ(read.mesh.free_nodes, read.mesh.nodes);
  EXPECT_EQ(read.mesh.components, 1);
  EXPECT_EQ(read.check.reoriented, truth.check.reoriented);
  EXPECT_EQ(read.check.unreferenced, truth.check.unreferenced);
  EXPECT_EQ(read.check.boundary_faces, truth.check.boundary_faces);
  EXPECT_NEAR(read.check.volume_m3, truth.check.volume_m3, 1e-12);
  EXPECT_NEAR(read.check.min_dihedral_deg, truth.check.min_dihedral_deg, 1e-9);
  EXPECT_NEAR(read.check.mean_ratio_mean, truth.check.mean_ratio_mean, 1e-12);
  const std::size_t width = local.nodes_per_tet();
  ASSERT_EQ(local.order, order);
  for (std::int32_t e = 0; e < local.tet_count(); ++e) {
    const auto tet = truth.mesh.tet(local.tet_in_mesh[e]);
    for (std::size_t i = 0; i < width; ++i) EXPECT_EQ(local.node_in_mesh[local.tets[static_cast<std::size_t>(e) * width + i]], tet[i]);
    EXPECT_EQ(local.region[e], truth.mesh.regions[local.tet_in_mesh[e]]);
  }
  for (std::size_t i = 0; i < local.nodes_m.size(); ++i) EXPECT_EQ(local.nodes_m[i], truth.mesh.nodes_m[local.node_in_mesh[i]]);
  std::int64_t sums[3] = {local.tet_count(), local.owned_nodes, local.free_nodes};
  MPI_Allreduce(MPI_IN_PLACE, sums, 3, MPI_INT64_T, MPI_SUM, kWorld);
  EXPECT_EQ(sums[0], read.mesh.tets);
  EXPECT_EQ(sums[1], read.mesh.nodes);
  EXPECT_EQ(sums[2], read.mesh.free_nodes);
  EXPECT_LT(read.mesh.report.element_balance, 1.01);
  EXPECT_LT(read.mesh.report.node_balance, 1.5);  // the highest rank owns its seams, which are much of so small a mesh
}

TEST_P(Orders, row_numbering) {
  const auto [file_order, order] = GetParam();
  const SharedFile file(make_shuffled_tube(file_order));
  const ParallelMesh read = read_parallel(kWorld, file.path(), {.order = order});
  const mesh::LocalMesh& local = read.mesh.local;
  // Every rank contributes its rows; largest and smallest values must agree, and owned rows are contiguous.
  std::vector<std::int32_t> low(read.mesh.nodes, INT32_MAX), high(low.size(), -1), owners(low.size(), 0);
  for (std::size_t i = 0; i < local.row.size(); ++i) {
    const std::size_t node = local.node_in_mesh[i];
    low[node] = std::min(low[node], local.row[i]);
    high[node] = std::max(high[node], local.row[i]);
    owners[node] += static_cast<std::int32_t>(i) < local.owned_nodes;
  }
  for (std::int32_t i = 0; i < local.free_nodes; ++i) EXPECT_EQ(local.row[i], local.first_row + i);
  MPI_Allreduce(MPI_IN_PLACE, low.data(), static_cast<int>(low.size()), MPI_INT32_T, MPI_MIN, kWorld);
  MPI_Allreduce(MPI_IN_PLACE, high.data(), static_cast<int>(high.size()), MPI_INT32_T, MPI_MAX, kWorld);
  MPI_Allreduce(MPI_IN_PLACE, owners.data(), static_cast<int>(owners.size()), MPI_INT32_T, MPI_SUM, kWorld);
  EXPECT_EQ(low, high);
  EXPECT_EQ(owners, std::vector<std::int32_t>(owners.size(), 1));
  EXPECT_EQ(std::set<std::int32_t>(high.begin(), high.end()).size(), high.size());
}

TEST_P(Orders, same_boundary_as_serial) {
  const auto [file_order, order] = GetParam();
  const mesh::TetMesh mesh = make_shuffled_tube(file_order);
  const SharedFile file(mesh);
  const ParallelMesh read = read_parallel(kWorld, file.path(), {.order = order});
  if (get_rank() != 0) {
    EXPECT_TRUE(read.boundary.vertices_m.empty());
    return;
  }
  const Truth truth = make_truth(mesh, order);
  EXPECT_EQ(read.boundary.triangles, truth.surface.triangles);
  ASSERT_EQ(read.boundary.vertices_m.size(), truth.surface.nodes.size());
  for (std::size_t v = 0; v < truth.surface.nodes.size(); ++v)
    EXPECT_EQ(read.boundary.vertices_m[v], truth.mesh.nodes_m[truth.surface.nodes[v]]);
}

INSTANTIATE_TEST_SUITE_P(All, Orders, testing::Values(std::pair(1, 1), std::pair(1, 2), std::pair(2, 1), std::pair(2, 2)),
                         [](const auto& info) {
                           return "from_" + std::to_string(info.param.first) + "_to_" + std::to_string(info.param.second);
                         });

TEST(FixedNodes, box_and_point_data) {
  const auto box = tests::make_box({4, 3, 2}, {4, 3, 2});
  std::vector<std::int32_t> side(box.nodes_m.size(), 0);
  for (std::size_t i = 0; i < side.size(); ++i) side[i] = box.nodes_m[i][0] == 0 ? 1 : box.nodes_m[i][0] == 4 ? -2 : 0;
  const SharedFile file(box, {.point_data = {{"side", side}}});
  const auto count = [&](const ReadOptions& options) {
    const ParallelMesh read = read_parallel(kWorld, file.path(), options);
    for (std::size_t i = 0; i < read.mesh.local.row.size(); ++i) {
      const double x = read.mesh.local.nodes_m[i][0];
      EXPECT_EQ(read.mesh.local.row[i] < 0, x == 0 || (options.fixed[0].node_set == "side" && x == 4));
    }
    EXPECT_EQ(read.mesh.fixed_m.size(), 1u);
    EXPECT_EQ(read.mesh.fixed_m[0].size(), 3u);
    EXPECT_EQ(read.mesh.free_nodes, read.mesh.nodes - read.fixed_nodes);
    return read.fixed_nodes;
  };
  EXPECT_EQ(count({.order = 1, .fixed = {{.node_set = "side:1"}}}), 4 * 3);
  EXPECT_EQ(count({.order = 1, .fixed = {{.node_set = "side"}}}), 2 * 4 * 3);
  EXPECT_EQ(count({.order = 2, .fixed = {{.node_set = "side:1"}}}), 7 * 5);  // the mid nodes between two fixed corners
  EXPECT_EQ(count({.order = 2, .fixed = {{.box_m = Box{{{0, 0, 0}, {0, 3, 2}}}}}}), 7 * 5);
}

TEST(FixedNodes, first_entry_wins) {
  // x = 0 by a set, y = 0 by a box; the edge of both belongs to the set, which comes first, and so do mid nodes between the two.
  const auto box = tests::make_box({4, 3, 2}, {4, 3, 2});
  std::vector<std::int32_t> side(box.nodes_m.size(), 0);
  for (std::size_t i = 0; i < side.size(); ++i) side[i] = box.nodes_m[i][0] == 0 ? 1 : 0;
  const SharedFile file(box, {.point_data = {{"side", side}}});
  for (const int order : {1, 2}) {
    const ParallelMesh read =
        read_parallel(kWorld, file.path(), {.order = order, .fixed = {{.node_set = "side"}, {.box_m = Box{{{0, 0, 0}, {4, 0, 2}}}}}});
    ASSERT_EQ(read.mesh.local.fixed_by.size(), read.mesh.local.nodes_m.size());
    for (std::size_t i = 0; i < read.mesh.local.row.size(); ++i) {
      const Vec3& x = read.mesh.local.nodes_m[i];
      EXPECT_EQ(read.mesh.local.fixed_by[i], x[0] == 0 ? 0 : x[1] == 0 ? 1 : -1) << x[0] << " " << x[1] << " " << x[2];
    }
  }
}

TEST(Components, numbering_by_first_node) {
  mesh::TetMesh three;
  for (int k : {2, 0, 1}) {  // in space in another order than in the file
    const auto one = tests::make_box({2, 2, 2}, {1, 1, 1}, 1, {5.0 * k, 0, 0});
    const auto shift = static_cast<std::int32_t>(three.nodes_m.size());
    three.nodes_m.insert(three.nodes_m.end(), one.nodes_m.begin(), one.nodes_m.end());
    for (const auto node : one.tets) three.tets.push_back(node + shift);
  }
  const SharedFile file(three);
  const ParallelMesh read = read_parallel(kWorld, file.path(), {.order = 1});
  EXPECT_EQ(read.mesh.components, 3);
  for (std::size_t i = 0; i < read.mesh.local.nodes_m.size(); ++i) {
    const double x = read.mesh.local.nodes_m[i][0];
    EXPECT_EQ(read.mesh.local.component[i], x >= 10 ? 0 : x < 5 ? 1 : 2);
  }
}

TEST(Cut, planar_cut_of_a_bar) {
  const auto bar = tests::make_box({60, 2, 2}, {60, 2, 2});
  const SharedFile file(bar);
  const ParallelMesh read = read_parallel(kWorld, file.path(), {.order = 1});
  EXPECT_TRUE(read.mesh.report.contiguous);
  // A plane across the bar meets 2 x 2 cells with two faces each; parts of equal size may need a step within a cell.
  EXPECT_LE(read.mesh.report.edge_cut, 24 * (get_ranks() - 1));
  EXPECT_GE(read.mesh.report.edge_cut, 8 * (get_ranks() - 1));
}

TEST(SinglePrecision, and_big_endian) {
  const auto box = tests::make_box({2, 2, 2}, {0.5, 0.25, 2});
  const SharedFile file(box, {.single_precision = true});
  const ParallelMesh read = read_parallel(kWorld, file.path(), {.order = 1});
  for (std::size_t i = 0; i < read.mesh.local.nodes_m.size(); ++i)
    EXPECT_EQ(read.mesh.local.nodes_m[i], box.nodes_m[read.mesh.local.node_in_mesh[i]]);
}

struct BadCase {
  std::string name;
  std::function<void(mesh::TetMesh&)> spoil;
  std::string words;
  ReadOptions options{.order = 1};
};

void PrintTo(const BadCase& bad, std::ostream* out) { *out << bad.name; }

class BadMeshes : public testing::TestWithParam<BadCase> {};

TEST_P(BadMeshes, collective_refusal) {
  mesh::TetMesh box = tests::make_box({4, 3, 2}, {4, 3, 2});
  GetParam().spoil(box);
  const SharedFile file(box);
  tests::expect_error<InputError>({GetParam().words, file.path().string()},
                                  [&] { read_parallel(kWorld, file.path(), GetParam().options); });
}

// Element 140 of 144: on one rank only.
INSTANTIATE_TEST_SUITE_P(
    All, BadMeshes,
    testing::Values(
        BadCase{"node_out_of_range", [](mesh::TetMesh& box) { box.tets[4 * 139 + 2] = 60; }, "element 140 refers to node 60"},
        BadCase{"negative_node", [](mesh::TetMesh& box) { box.tets[4 * 139 + 2] = -1; }, "element 140 refers to node -1"},
        BadCase{"repeated_node", [](mesh::TetMesh& box) { box.tets[4 * 139 + 2] = box.tets[4 * 139]; },
                "1 element with a repeated node: 140"},
        BadCase{"no_number", [](mesh::TetMesh& box) { box.nodes_m[58][1] = std::numeric_limits<double>::quiet_NaN(); },
                "node 59 has a coordinate"},
        BadCase{"flat_element",
                [](mesh::TetMesh& box) {
                  box.nodes_m.push_back({9, 9, 9});
                  box.nodes_m.push_back({9, 8, 9});
                  box.nodes_m.push_back({8, 9, 9});
                  box.nodes_m.push_back({8, 8, 9});
                  box.tets.insert(box.tets.end(), {60, 61, 62, 63});
                },
                "1 element without volume: 145"},
        BadCase{"element_twice", [](mesh::TetMesh& box) { box.tets.insert(box.tets.end(), box.tets.begin() + 40, box.tets.begin() + 44); },
                "element 145 is given twice (it has the corners of element 11"},
        BadCase{"three_elements_on_a_face",
                [](mesh::TetMesh& box) {
                  // A spike out of the middle of a face that two elements of the box share already.
                  const auto corners = std::set<std::int32_t>(box.tets.begin(), box.tets.begin() + 4);
                  for (std::size_t e = 1; e < 6; ++e) {
                    std::vector<std::int32_t> common;
                    for (std::size_t i = 0; i < 4; ++i)
                      if (corners.contains(box.tets[4 * e + i])) common.push_back(box.tets[4 * e + i]);
                    if (common.size() != 3) continue;
                    box.nodes_m.push_back({-1, 0.3, 0.1});
                    box.tets.insert(box.tets.end(), {common[0], common[1], common[2], 60});
                    return;
                  }
                },
                "belongs to 3 elements"},
        BadCase{"edge_between_two_bodies",
                [](mesh::TetMesh& box) {
                  const auto end = static_cast<std::int32_t>(box.nodes_m.size());
                  box.nodes_m.push_back({-1, 0.2, -1});
                  box.nodes_m.push_back({-1, 0.8, -1.5});
                  box.tets.insert(box.tets.end(), {0, 5, end, end + 1});  // hangs on the edge of the nodes 0 and 5
                },
                "the boundary is not a closed surface"},
        BadCase{"unknown_set",
                [](mesh::TetMesh&) {},
                "job.json:3: key 'fixed': ",
                {.order = 1, .fixed = {{.node_set = "clamp", .place = "job.json:3: key 'fixed'"}}}},
        BadCase{
            "empty_box", [](mesh::TetMesh&) {}, "no node lies in the box", {.order = 1, .fixed = {{.box_m = Box{{{7, 7, 7}, {8, 8, 8}}}}}}},
        BadCase{
            "all_fixed", [](mesh::TetMesh&) {}, "names every node", {.order = 1, .fixed = {{.box_m = Box{{{-1, -1, -1}, {8, 8, 8}}}}}}}),
    [](const auto& info) { return info.param.name; });

TEST(Format, detection_by_signature) {
  const SharedFile file(tests::make_box({1, 1, 1}, {1, 1, 1}));
  EXPECT_TRUE(is_parallel_format(file.path()));
  EXPECT_FALSE(is_parallel_format("/proc/self/status"));
  EXPECT_FALSE(is_parallel_format("/no/such/file"));
}

TEST(FewElements, one_per_rank) {
  mesh::TetMesh one;
  one.nodes_m = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  one.tets = {0, 1, 2, 3};
  {
    const SharedFile file(one);
    if (get_ranks() == 1)
      EXPECT_EQ(read_parallel(kWorld, file.path(), {.order = 1}).mesh.free_nodes, 4);
    else
      EXPECT_THROW(read_parallel(kWorld, file.path(), {.order = 1}), InputError);
  }
  const SharedFile cube(tests::make_box({1, 1, 1}, {1, 1, 1}));
  const ParallelMesh read = read_parallel(kWorld, cube.path(), {.order = 2});
  EXPECT_GE(read.mesh.local.tet_count(), 1);
  EXPECT_EQ(read.mesh.nodes, 27);
}

}  // namespace
}  // namespace carillon::parallel_mesh
