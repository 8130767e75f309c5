// Each mesh defect separately, on bodies with answers known by hand.
#include "precompute/mesh/check.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <set>

#include "precompute/mesh/read.hpp"
#include "precompute/mesh/write.hpp"
#include "runtime/base/error.hpp"
#include "tests/support/catch_message.hpp"
#include "tests/unit/precompute/mesh/truth.hpp"

namespace carillon::mesh {
namespace {

TetMesh make_one() { return {1, {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, {0, 1, 2, 3}, {0}, {}, {}, {}}; }

/// Two elements on the face 1 2 3 of the unit simplex.
TetMesh make_two() {
  TetMesh mesh = make_one();
  mesh.nodes_m.push_back({1, 1, 1});
  mesh.tets.insert(mesh.tets.end(), {1, 2, 3, 4});
  mesh.regions = {0, 0};
  return mesh;
}

/// n x n x n cubes of six tetrahedra each around the diagonal (Kuhn), edge 1/n, all positively oriented.
TetMesh make_cube(int n) {
  TetMesh mesh;
  const auto node = [n](int i, int j, int k) { return static_cast<std::int32_t>((k * (n + 1) + j) * (n + 1) + i); };
  for (int k = 0; k <= n; ++k)
    for (int j = 0; j <= n; ++j)
      for (int i = 0; i <= n; ++i) mesh.nodes_m.push_back({double(i) / n, double(j) / n, double(k) / n});
  const int paths[6][3] = {{0, 1, 2}, {1, 2, 0}, {2, 0, 1}, {0, 2, 1}, {1, 0, 2}, {2, 1, 0}};
  for (int k = 0; k < n; ++k)
    for (int j = 0; j < n; ++j)
      for (int i = 0; i < n; ++i)
        for (int p = 0; p < 6; ++p) {
          int at[3] = {i, j, k};
          std::int32_t tet[4] = {node(i, j, k), 0, 0, 0};
          for (int s = 0; s < 3; ++s) {
            ++at[paths[p][s]];
            tet[s + 1] = node(at[0], at[1], at[2]);
          }
          if (p >= 3) std::swap(tet[1], tet[2]);  // the odd paths
          mesh.tets.insert(mesh.tets.end(), tet, tet + 4);
        }
  mesh.regions.assign(mesh.tet_count(), 0);
  return mesh;
}

std::string find_refusal(TetMesh mesh) {
  return tests::catch_message<InputError>([&] { check_mesh(mesh, "body.msh"); });
}

void expect_refusal(const TetMesh& mesh, std::initializer_list<const char*> words) {
  const std::string message = find_refusal(mesh);
  EXPECT_TRUE(message.starts_with("body.msh: ")) << message;
  for (const char* word : words) EXPECT_NE(message.find(word), std::string::npos) << word << " is not in: " << message;
}

TEST(check, sound_mesh_unchanged) {
  TetMesh mesh = make_cube(3);
  const TetMesh before = mesh;
  const CheckReport report = check_mesh(mesh);
  EXPECT_EQ(mesh.tets, before.tets);
  EXPECT_EQ(mesh.nodes_m, before.nodes_m);
  EXPECT_EQ(report.reoriented + report.unreferenced + report.welded + report.straightened, 0);
  EXPECT_EQ(report.components, 1);
  EXPECT_EQ(report.boundary_faces, 6 * 9 * 2);
  EXPECT_NEAR(report.volume_m3, 1.0, 1e-12);
  EXPECT_TRUE(report.warnings.empty());
  // A Kuhn tetrahedron has dihedral angles of 45, 60 and 90 degrees; edges 1, 1, 1, sqrt 2, sqrt 2, sqrt 3; volume 1/6.
  EXPECT_NEAR(report.min_dihedral_deg, 45.0, 1e-9);
  EXPECT_NEAR(report.max_dihedral_deg, 90.0, 1e-9);
  EXPECT_NEAR(report.mean_ratio_min, 12.0 * std::pow(0.5, 2.0 / 3.0) / 10.0, 1e-12);
  EXPECT_NEAR(report.mean_ratio_mean, report.mean_ratio_1_percent, 1e-12);
}

TEST(check, regular_tetrahedron_quality) {
  TetMesh mesh{1, {{1, 1, 1}, {1, -1, -1}, {-1, 1, -1}, {-1, -1, 1}}, {0, 1, 2, 3}, {}, {}, {}, {}};
  const CheckReport report = check_mesh(mesh);
  EXPECT_NEAR(report.mean_ratio_min, 1.0, 1e-12);
  EXPECT_NEAR(report.min_dihedral_deg, 70.528779365509308, 1e-9);
  EXPECT_NEAR(report.max_dihedral_deg, 70.528779365509308, 1e-9);
  EXPECT_NEAR(report.volume_m3, 8.0 / 3.0, 1e-12);
}

TEST(check, inverted_elements) {
  for (const int order : {1, 2}) {
    TetMesh mesh = make_cube(2);
    if (order == 2) mesh = to_quadratic(mesh);
    const std::size_t width = mesh.nodes_per_tet();
    for (const std::size_t e : {0U, 7U, 20U}) {
      // Mirrored by exchanging corners 0 and 3: edges 01 and 13, 02 and 23 change places.
      std::swap(mesh.tets[e * width], mesh.tets[e * width + 3]);
      if (order == 2) {
        std::swap(mesh.tets[e * width + 4], mesh.tets[e * width + 8]);
        std::swap(mesh.tets[e * width + 6], mesh.tets[e * width + 9]);
      }
    }
    const CheckReport report = check_mesh(mesh);
    EXPECT_EQ(report.reoriented, 3);
    EXPECT_NEAR(calc_volume(mesh), 1.0, 1e-12);
    EXPECT_NEAR(report.volume_m3, 1.0, 1e-12);
    EXPECT_EQ(report.curved, 0) << "the mid nodes went with their edges";
  }
}

TEST(check, unreferenced_nodes) {
  TetMesh mesh = make_two();
  mesh.nodes_m.insert(mesh.nodes_m.begin(), {9, 9, 9});
  for (auto& node : mesh.tets) ++node;
  mesh.node_sets = {{"s", {0, 1, 5}}};
  const CheckReport report = check_mesh(mesh);
  EXPECT_EQ(report.unreferenced, 1);
  EXPECT_EQ(mesh.nodes_m.size(), 5U);
  EXPECT_EQ(mesh.node_sets.at("s"), (std::vector<std::int32_t>{0, 4}));
  EXPECT_NEAR(calc_volume(mesh), 1.0 / 6.0 + 1.0 / 3.0, 1e-14);
}

TEST(check, crack_welding) {
  for (const int order : {1, 2}) {
    TetMesh mesh = make_cube(2);
    if (order == 2) mesh = to_quadratic(mesh);
    const std::size_t whole = mesh.nodes_m.size();
    // The elements above z = 1/2 get nodes of their own, moved by a rounding error.
    std::vector<std::int32_t> twin(whole, -1);
    std::int64_t split = 0;
    for (std::int64_t e = mesh.tet_count() / 2; e < mesh.tet_count(); ++e)
      for (int k = 0; k < mesh.nodes_per_tet(); ++k) {
        auto& node = mesh.tets[e * mesh.nodes_per_tet() + k];
        if (std::abs(mesh.nodes_m[node][2] - 0.5) > 1e-9) continue;
        if (twin[node] < 0) {
          twin[node] = static_cast<std::int32_t>(mesh.nodes_m.size());
          Vec3 x = mesh.nodes_m[node];
          x[0] += 3e-16;
          mesh.nodes_m.push_back(x);
          ++split;
        }
        node = twin[node];
      }
    const auto last = static_cast<std::int32_t>(mesh.nodes_m.size()) - 1;
    mesh.node_sets = {{"of the upper half", {last}}};
    const Vec3 place = mesh.nodes_m.back();
    const CheckReport report = check_mesh(mesh);
    EXPECT_EQ(report.welded, split);
    EXPECT_EQ(report.components, 1);
    EXPECT_EQ(mesh.nodes_m.size(), whole);
    EXPECT_EQ(report.boundary_faces, 6 * 4 * 2);
    ASSERT_EQ(mesh.node_sets.at("of the upper half").size(), 1U);
    EXPECT_NEAR(mesh.nodes_m[mesh.node_sets.at("of the upper half")[0]][1], place[1], 1e-12);
    ASSERT_FALSE(report.warnings.empty());
    EXPECT_NE(report.warnings[0].find("repeated nodes were joined"), std::string::npos);
  }
}

TEST(check, unshared_nodes_welding) {
  for (const int order : {1, 2}) {
    const TetMesh whole = order == 1 ? make_cube(3) : to_quadratic(make_cube(3));
    TetMesh mesh = whole;
    mesh.nodes_m.clear();
    for (auto& node : mesh.tets) {
      mesh.nodes_m.push_back(whole.nodes_m[node]);
      node = static_cast<std::int32_t>(mesh.nodes_m.size()) - 1;
    }
    const CheckReport report = check_mesh(mesh);
    EXPECT_EQ(mesh.nodes_m.size(), whole.nodes_m.size());
    EXPECT_EQ(report.welded, static_cast<std::int64_t>(whole.tets.size() - whole.nodes_m.size()));
    EXPECT_EQ(report.unreferenced, 0);
    EXPECT_EQ(report.components, 1);
    EXPECT_EQ(place_tets(mesh), place_tets(whole));
  }
}

TEST(check, touching_bodies) {
  TetMesh mesh = make_one();
  for (const Vec3& x : {Vec3{1, 0, 0}, Vec3{2, 0, 0}, Vec3{1, 1, 0}, Vec3{1, 0, 1}}) mesh.nodes_m.push_back(x);
  mesh.tets.insert(mesh.tets.end(), {4, 5, 6, 7});
  const CheckReport report = check_mesh(mesh);
  EXPECT_EQ(report.welded, 0);
  EXPECT_EQ(report.touching_nodes, 1);
  EXPECT_EQ(report.components, 2);
  EXPECT_EQ(report.component_of_node, (std::vector<std::int32_t>{0, 0, 0, 0, 1, 1, 1, 1}));
  EXPECT_NE(report.warnings.at(0).find("not merged"), std::string::npos);
}

TEST(check, pinched_node_warning) {
  TetMesh mesh = make_one();
  for (const Vec3& x : {Vec3{2, 0, 0}, Vec3{1, 1, 0}, Vec3{1, 0, 1}}) mesh.nodes_m.push_back(x);
  mesh.tets.insert(mesh.tets.end(), {1, 4, 5, 6});
  const CheckReport report = check_mesh(mesh);
  EXPECT_EQ(report.components, 1);
  EXPECT_EQ(report.pinched_nodes, 1);
  EXPECT_NE(report.warnings.at(0).find("at a point only"), std::string::npos);
}

TEST(check, flat_elements) {
  TetMesh mesh = make_two();
  mesh.nodes_m[4] = {1.0 / 3, 1.0 / 3, 1.0 / 3};
  EXPECT_EQ(count_flat(mesh), 1);
  expect_refusal(mesh, {"1 element without volume: 2", "counted from 1", "Mesh.Optimize"});
  mesh = make_cube(3);
  for (auto& x : mesh.nodes_m) x[2] = 0.0;
  expect_refusal(mesh, {"162 elements without volume: 1, 2, 3, 4, 5, 6, 7, 8, 9, 10 and 152 more"});
}

TEST(check, coincident_nodes_in_element) {
  TetMesh mesh = make_two();
  mesh.nodes_m[4] = mesh.nodes_m[3];
  expect_refusal(mesh, {"without volume: 2"});
}

TEST(check, overlapping_elements) {
  TetMesh mesh = make_two();
  mesh.nodes_m[4] = {0.1, 0.1, 0.1};
  expect_refusal(mesh, {"elements 1 and 2", "same side", "nodes 2, 3, 4", "apexes 1 and 5", "inverted"});
}

TEST(check, node_beyond_opposite_face) {
  TetMesh mesh = make_cube(3);
  mesh.nodes_m[1 + 4 * 1 + 16 * 1] = {0.75, 0.75, 0.75};  // an inner node beyond its neighbours
  expect_refusal(mesh, {"same side", "inverted"});
}

TEST(check, face_of_three_elements) {
  TetMesh mesh = make_two();
  mesh.nodes_m.push_back({2, 2, 2.5});
  mesh.tets.insert(mesh.tets.end(), {1, 2, 3, 5});
  expect_refusal(mesh, {"the face of nodes 2, 3 and 4 belongs to 3 elements: 1, 2, 3"});
}

TEST(check, duplicate_element) {
  TetMesh mesh = make_two();
  mesh.tets.insert(mesh.tets.end(), {4, 3, 1, 2});
  expect_refusal(mesh, {"1 element is given twice: 3", "has the corners of 2"});
}

TEST(check, repeated_node) {
  TetMesh mesh = make_two();
  mesh.tets[7] = 2;
  expect_refusal(mesh, {"1 element with a repeated node: 2"});
}

TEST(check, index_out_of_range) {
  TetMesh mesh = make_two();
  mesh.tets[7] = 5;
  expect_refusal(mesh, {"element 2 refers to node 6", "from 1 to 5"});
  mesh.tets[7] = -1;
  expect_refusal(mesh, {"element 2 refers to node 0"});
  mesh = make_two();
  mesh.node_sets = {{"far", {77}}};
  expect_refusal(mesh, {"'far'", "node 78"});
}

TEST(check, nonfinite_coordinate) {
  TetMesh mesh = make_two();
  mesh.nodes_m[2][1] = NAN;
  expect_refusal(mesh, {"node 3", "not finite"});
}

TEST(check, bodies_sharing_an_edge) {
  TetMesh mesh = make_one();
  mesh.nodes_m.push_back({0, -1, 0});
  mesh.nodes_m.push_back({0, 0, -1});
  mesh.tets.insert(mesh.tets.end(), {0, 1, 4, 5});
  expect_refusal(mesh, {"not a closed surface", "between nodes 1 and 2", "4 boundary faces instead of 2", "elements 1, 1, 2, 2"});
}

TEST(check, contradictory_mid_nodes) {
  TetMesh mesh = to_quadratic(make_two());
  Vec3 x = mesh.nodes_m[mesh.tets[10 + 4]];
  x[0] += 0.1;
  mesh.tets[10 + 4] = static_cast<std::int32_t>(mesh.nodes_m.size());
  mesh.nodes_m.push_back(x);
  expect_refusal(mesh, {"elements 1 and 2 share the edge of nodes 2 and 3", "different mid nodes"});
}

TEST(check, curved_and_folded_elements) {
  TetMesh mesh = to_quadratic(make_one());
  mesh.nodes_m[mesh.tets[4]][1] -= 0.05;  // the middle of edge 01 bulges outwards
  CheckReport report = check_mesh(mesh);
  EXPECT_EQ(report.curved, 1);
  EXPECT_EQ(report.straightened, 0);
  // A straight edge bulging by b over the faces z = 0 and y = 0: the volume gained is that of the quadratic map, by an independent
  // quadrature.
  EXPECT_GT(report.volume_m3, 1.0 / 6.0);
  mesh.nodes_m[mesh.tets[4]] = {0.1, 0.9, 0.9};
  report = check_mesh(mesh);
  EXPECT_EQ(report.straightened, 1);
  EXPECT_EQ(report.curved, 0);
  EXPECT_NEAR(report.volume_m3, 1.0 / 6.0, 1e-14);
}

TEST(check, curved_element_volume) {
  // Mapping of a simplex by a known smooth quadratic map: x -> x + a y^2 has Jacobian 1, so the volume stays; the mid nodes move exactly.
  TetMesh mesh = to_quadratic(make_cube(2));
  for (auto& x : mesh.nodes_m) x[0] += 0.3 * x[1] * x[1];
  const CheckReport report = check_mesh(mesh);
  EXPECT_GT(report.curved, 0);
  EXPECT_NEAR(report.volume_m3, 1.0, 1e-12);
}

TEST(check, sliver_and_size_warnings) {
  TetMesh mesh{1, {{0, 0, 0}, {1, 0, 0}, {0.5, 1, 0}, {0.5, 0.4, 0.01}}, {0, 1, 2, 3}, {}, {}, {}, {}};
  EXPECT_EQ(check_mesh(mesh).slivers, 1);
  TetMesh large = make_cube(2);
  for (auto& x : large.nodes_m) x = {100 * x[0], 100 * x[1], 100 * x[2]};
  EXPECT_NE(check_mesh(large).warnings.at(0).find("millimetres given as metres"), std::string::npos);
}

TEST(boundary, orientation_and_volume) {
  for (const int order : {1, 2}) {
    TetMesh mesh = make_cube(3);
    if (order == 2) mesh = to_quadratic(mesh);
    const Surface surface = extract_boundary(mesh);
    EXPECT_EQ(surface.triangles.size(), 6U * 9 * 2 * (order == 2 ? 4 : 1));
    EXPECT_EQ(surface.tets.size(), surface.triangles.size());
    double volume = 0.0;
    std::multiset<std::pair<int, int>> edges;
    for (const auto& t : surface.triangles) {
      const auto at = [&](int k) { return mesh.nodes_m[surface.nodes[t[k]]]; };
      const Vec3 a = at(0), b = at(1), c = at(2);
      volume += (a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) + a[2] * (b[0] * c[1] - b[1] * c[0])) / 6.0;
      for (std::size_t k = 0; k < 3; ++k) edges.insert({t[k], t[(k + 1) % 3]});
    }
    EXPECT_NEAR(volume, 1.0, 1e-12);
    for (const auto& [i, j] : edges) ASSERT_EQ(edges.count({j, i}), 1U) << "edge " << i << " " << j;
    // Euler: V - E + F = 2 for a ball.
    EXPECT_EQ(static_cast<long>(surface.nodes.size()) - static_cast<long>(edges.size() / 2) + static_cast<long>(surface.triangles.size()),
              2);
    EXPECT_TRUE(std::is_sorted(surface.nodes.begin(), surface.nodes.end()));
  }
}

TEST(quadratic, round_trip_to_linear) {
  TetMesh mesh = make_cube(3);
  mesh.node_sets = {{"floor", {}}};
  for (std::int32_t i = 0; i < 16; ++i) mesh.node_sets["floor"].push_back(i);
  const TetMesh fine = to_quadratic(mesh);
  // Euler for the solid ball: V - E + F - T = 1, F = (4 T + boundary) / 2; one node per edge.
  const auto faces = (4 * mesh.tet_count() + 6 * 9 * 2) / 2;
  const auto edges = static_cast<std::int64_t>(mesh.nodes_m.size()) + faces - mesh.tet_count() - 1;
  EXPECT_EQ(static_cast<std::int64_t>(fine.nodes_m.size()), static_cast<std::int64_t>(mesh.nodes_m.size()) + edges);
  EXPECT_EQ(fine.node_sets.at("floor").size(), 49U);  // a 7 x 7 grid of corners and mid nodes
  const TetMesh back = to_linear(fine);
  EXPECT_EQ(back.nodes_m, mesh.nodes_m);
  EXPECT_EQ(back.tets, mesh.tets);
  EXPECT_EQ(back.node_sets, mesh.node_sets);
}

TEST(find_fixed_nodes, named_sets) {
  const TetMesh mesh = read_mesh(fixture("gmsh41_text_1.msh"));
  EXPECT_LT(find_distance(place_nodes(mesh, find_fixed_nodes(mesh, "clamp")), read_truth(1).groups.at("clamp")), 1e-11);
  tests::expect_error<InputError>({"no node set 'clmap'", "did you mean 'clamp'?", "'rim'", "'physical:9'"},
                                  [&] { find_fixed_nodes(mesh, "clmap"); });
}

TEST(find_fixed_nodes, closed_box) {
  const TetMesh mesh = make_cube(10);
  EXPECT_EQ(find_fixed_nodes(mesh, {0, 0, 0}, {0.3, 1, 1}).size(), 4U * 11 * 11);  // 3 / 10 is not 0.3 to the last bit
  EXPECT_EQ(find_fixed_nodes(mesh, {0.5, 0.5, 0.5}, {0.5, 0.5, 0.5}).size(), 1U);
  EXPECT_THROW(find_fixed_nodes(mesh, {2, 2, 2}, {3, 3, 3}), InputError);
  EXPECT_THROW(find_fixed_nodes(mesh, {1, 0, 0}, {0, 1, 1}), InputError);
}

TEST(speed, demo_size_mesh) {
  // Target 0.3 s each; times are printed and recorded, not checked: machines are shared.
  const tests::Folder scratch;
  write_gmsh(make_cube(31), scratch / "large.msh");
  const auto begin = std::chrono::steady_clock::now();
  TetMesh mesh = read_mesh(scratch / "large.msh");
  const auto middle = std::chrono::steady_clock::now();
  check_mesh(mesh);
  const auto end = std::chrono::steady_clock::now();
  EXPECT_EQ(mesh.tet_count(), 178746);
  const double read_s = std::chrono::duration<double>(middle - begin).count(),
               check_s = std::chrono::duration<double>(end - middle).count();
  RecordProperty("read_s", std::to_string(read_s));
  RecordProperty("check_s", std::to_string(check_s));
  std::printf("read %.3f s, checked %.3f s\n", read_s, check_s);
}

}  // namespace
}  // namespace carillon::mesh
