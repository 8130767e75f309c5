// Every format and encoding against Gmsh's data; files written by Gmsh, VTK, meshio and TetGen.
#include "precompute/mesh/read.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "precompute/mesh/check.hpp"
#include "runtime/base/error.hpp"
#include "tests/unit/precompute/mesh/truth.hpp"

namespace carillon::mesh {
namespace {

void expect_truth(TetMesh mesh, int order) {
  const Truth truth = read_truth(order);
  ASSERT_EQ(mesh.order, order);
  ASSERT_EQ(static_cast<std::size_t>(mesh.tet_count()), truth.tets.size());
  check_mesh(mesh);
  EXPECT_EQ(mesh.nodes_m.size(), truth.nodes);
  const auto tets = place_tets(mesh);
  double distance = 0.0;
  for (std::size_t e = 0; e < tets.size(); ++e) distance = std::max(distance, find_distance(tets[e], truth.tets[e]));
  EXPECT_LT(distance, 1e-11);
  EXPECT_NEAR(calc_volume(mesh), 0.3 * 0.2 * 0.1, 1e-12);
}

/// Correct node order: every mid node lies at the midpoint of its own edge.
void expect_mid_nodes_in_the_middle(const TetMesh& mesh) {
  ASSERT_EQ(mesh.order, 2);
  for (std::int64_t e = 0; e < mesh.tet_count(); ++e)
    for (std::size_t m = 0; m < 6; ++m) {
      const auto at = [&](std::size_t k) { return mesh.nodes_m.at(mesh.tet(e)[k]); };
      const Vec3 a = at(kEdges[m][0]), b = at(kEdges[m][1]), x = at(4 + m);
      for (std::size_t k = 0; k < 3; ++k) ASSERT_NEAR(x[k], 0.5 * (a[k] + b[k]), 1e-12) << "element " << e << " edge " << m;
    }
}

class EveryFile : public testing::TestWithParam<std::string> {};

TEST_P(EveryFile, same_mesh_as_gmsh) {
  const int order = GetParam().find("2.") != std::string::npos ? 2 : 1;
  const TetMesh mesh = read_mesh(fixture(GetParam()));
  expect_truth(mesh, order);
  if (order == 2) expect_mid_nodes_in_the_middle(mesh);
}

INSTANTIATE_TEST_SUITE_P(fixtures, EveryFile,
                         testing::Values("gmsh22_text_1.msh", "gmsh22_text_2.msh", "gmsh22_binary_1.msh", "gmsh22_binary_2.msh",
                                         "gmsh41_text_1.msh", "gmsh41_text_2.msh", "gmsh41_binary_1.msh", "gmsh41_binary_2.msh",
                                         "gmsh22_views_text_1.msh", "gmsh22_views_binary_1.msh", "gmsh41_views_text_1.msh",
                                         "gmsh41_views_binary_1.msh", "gmsh22_parametric_text_2.msh", "gmsh22_parametric_binary_2.msh",
                                         "gmsh41_parametric_text_2.msh", "gmsh41_parametric_binary_2.msh", "gmsh22_parted_text_2.msh",
                                         "gmsh22_parted_binary_2.msh", "gmsh41_parted_text_2.msh", "gmsh41_parted_binary_2.msh",
                                         "meshio41_1.msh", "meshio41_2.msh", "medit_1.mesh", "medit_2.mesh", "gmsh_1.mesh",
                                         "medit_gmsh_order_2.mesh", "medit_ordering_2.mesh", "meshio_1.node", "meshio_1.ele",
                                         "meshio_ascii_1.vtu", "meshio_ascii_2.vtu", "meshio_plain_1.vtu", "meshio_plain_2.vtu",
                                         "meshio_zlib_1.vtu", "meshio_zlib_2.vtu", "vtk_ascii_1.vtu", "vtk_ascii_2.vtu", "vtk_inline_1.vtu",
                                         "vtk_inline_2.vtu", "vtk_inline64_1.vtu", "vtk_inline64_2.vtu", "vtk_inline_zlib_1.vtu",
                                         "vtk_inline_zlib_2.vtu", "vtk_appended_1.vtu", "vtk_appended_2.vtu", "vtk_appended_zlib64_1.vtu",
                                         "vtk_appended_zlib64_2.vtu", "vtk_raw_1.vtu", "vtk_raw_2.vtu", "vtk_raw_zlib_1.vtu",
                                         "vtk_raw_zlib_2.vtu", "vtk_raw64_big_1.vtu", "vtk_raw64_big_2.vtu"),
                         [](const auto& info) {
                           std::string name = info.param;
                           std::replace(name.begin(), name.end(), '.', '_');
                           return name;
                         });

class GmshFile : public testing::TestWithParam<std::string> {};

TEST_P(GmshFile, physical_groups_and_regions) {
  const Truth truth = read_truth(GetParam().find("2.") != std::string::npos ? 2 : 1);
  const TetMesh mesh = read_mesh(fixture(GetParam()));
  ASSERT_EQ(mesh.node_sets.size(), truth.groups.size());
  for (const auto& [name, points] : truth.groups) {
    ASSERT_TRUE(mesh.node_sets.contains(name)) << name;
    EXPECT_LT(find_distance(place_nodes(mesh, mesh.node_sets.at(name)), points), 1e-11) << name;
    EXPECT_TRUE(std::is_sorted(mesh.node_sets.at(name).begin(), mesh.node_sets.at(name).end()));
  }
  EXPECT_EQ(std::count(mesh.regions.begin(), mesh.regions.end(), 7), mesh.tet_count());
}

INSTANTIATE_TEST_SUITE_P(fixtures, GmshFile,
                         testing::Values("gmsh22_text_1.msh", "gmsh22_text_2.msh", "gmsh22_binary_1.msh", "gmsh22_binary_2.msh",
                                         "gmsh41_text_1.msh", "gmsh41_text_2.msh", "gmsh41_binary_1.msh", "gmsh41_binary_2.msh",
                                         "gmsh22_views_text_1.msh", "gmsh22_views_binary_1.msh", "gmsh41_views_text_1.msh",
                                         "gmsh41_views_binary_1.msh", "gmsh22_parametric_text_2.msh", "gmsh22_parametric_binary_2.msh",
                                         "gmsh41_parametric_text_2.msh", "gmsh41_parametric_binary_2.msh", "gmsh22_parted_text_2.msh",
                                         "gmsh22_parted_binary_2.msh", "gmsh41_parted_text_2.msh", "gmsh41_parted_binary_2.msh"),
                         [](const auto& info) { return info.param.substr(0, info.param.size() - 4); });

TEST(read, node_sets_and_regions) {
  for (const auto& [file, set, order] : {std::tuple{"vtk_ascii_1.vtu", "clamp", 1},
                                         {"vtk_raw_zlib_2.vtu", "clamp:3", 2},
                                         {"meshio_zlib_2.vtu", "clamp", 2},
                                         {"medit_1.mesh", "ref:3", 1},
                                         {"medit_ordering_2.mesh", "ref:3", 2},
                                         {"meshio_1.node", "marker:3", 1}}) {
    const TetMesh mesh = read_mesh(fixture(file));
    ASSERT_TRUE(mesh.node_sets.contains(set)) << file;
    EXPECT_LT(find_distance(place_nodes(mesh, mesh.node_sets.at(set)), read_truth(order).groups.at("clamp")), 1e-11) << file;
    EXPECT_EQ(std::count(mesh.regions.begin(), mesh.regions.end(), 7), mesh.tet_count()) << file;
  }
}

TEST(read, tetgen_mid_nodes) {
  for (const char* file : {"tetgen1.1.node", "tetgen1.1.ele", "tetgen2.1.node", "tetgen2.1.ele"}) {
    TetMesh mesh = read_mesh(fixture(file));
    if (mesh.order == 2) expect_mid_nodes_in_the_middle(mesh);
    EXPECT_EQ(mesh.order, std::string(file).starts_with("tetgen2") ? 2 : 1);
    const CheckReport report = check_mesh(mesh);
    EXPECT_EQ(report.components, 1);
    EXPECT_NEAR(calc_volume(mesh), 0.3 * 0.2 * 0.1, 1e-12) << file;
    EXPECT_EQ(std::count(mesh.regions.begin(), mesh.regions.end(), 7), mesh.tet_count());
    ASSERT_TRUE(mesh.node_sets.contains("marker:4"));
  }
}

// Gmsh (4.8) saves second order as rows of 11 and 7 numbers under the keywords of the first.
TEST(read, medit_second_order_by_gmsh) {
  std::string text = read_text(fixture("medit_2.mesh"));
  for (const std::string word : {"TetrahedraP2", "TrianglesP2"}) {
    const auto at = text.find(word + "\n");
    if (at != std::string::npos) text.erase(at + word.size() - 2, 2);
  }
  ASSERT_EQ(text.find("P2"), std::string::npos);
  text.insert(text.find("Tetrahedra"), "Triangles\n1\n1 2 3 4 5 6 9\n");
  TetMesh mesh = parse_mesh(std::as_bytes(std::span(text)), "gmsh.mesh", MeshFormat::kMedit);
  const TetMesh truth = read_mesh(fixture("medit_2.mesh"));
  EXPECT_EQ(mesh.order, 2);
  EXPECT_EQ(mesh.tets, truth.tets);
  EXPECT_EQ(mesh.node_sets["triangles:9"].size(), 6u);
  mesh.node_sets.erase("triangles:9");
  EXPECT_EQ(mesh.node_sets, truth.node_sets);
}

TEST(read, medit_triangle_references) {
  // In a file of Gmsh's the reference of a triangle is the number of its surface: six of them cover the box.
  const TetMesh mesh = read_mesh(fixture("gmsh_1.mesh"));
  int faces = 0;
  for (const auto& [name, set] : mesh.node_sets) {
    if (!name.starts_with("triangles:")) continue;
    ++faces;
    bool flat = false;
    for (std::size_t k = 0; k < 3; ++k) {
      double low = 1.0, high = -1.0;
      for (const auto i : set) {
        low = std::min(low, mesh.nodes_m[i][k]);
        high = std::max(high, mesh.nodes_m[i][k]);
      }
      flat = flat || high - low < 1e-12;
    }
    EXPECT_TRUE(flat) << name;
  }
  EXPECT_EQ(faces, 6);
}

TEST(read, line_ends_and_comments) {
  const tests::Folder scratch;
  for (const char* file : {"gmsh22_text_1.msh", "gmsh41_text_2.msh", "medit_1.mesh", "vtk_ascii_1.vtu"}) {
    std::string text;
    for (const char c : read_text(fixture(file))) text += c == '\n' ? std::string("\r\n") : std::string(1, c);
    while (text.back() == '\n' || text.back() == '\r') text.pop_back();
    const auto path = scratch / file;
    write_text(path, text);
    const TetMesh changed = read_mesh(path), mesh = read_mesh(fixture(file));
    EXPECT_EQ(changed.nodes_m, mesh.nodes_m) << file;
    EXPECT_EQ(changed.tets, mesh.tets) << file;
    EXPECT_EQ(changed.node_sets, mesh.node_sets) << file;
  }
}

TEST(read, gmsh_2_element_in_two_groups) {
  const std::string text =
      "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n2\n3 1 \"body\"\n3 2 \"half\"\n$EndPhysicalNames\n"
      "$Nodes\n5\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n5 1 1 1\n$EndNodes\n"
      "$Elements\n3\n1 4 2 1 1 1 2 3 4\n2 4 2 1 1 2 5 3 4\n3 4 2 2 1 2 5 3 4\n$EndElements\n";
  const TetMesh mesh = parse_mesh(std::as_bytes(std::span(text)), "two.msh", MeshFormat::kGmsh);
  EXPECT_EQ(mesh.tet_count(), 2);
  EXPECT_EQ(mesh.node_sets.at("body").size(), 5U);
  EXPECT_EQ(mesh.node_sets.at("half"), (std::vector<std::int32_t>{1, 2, 3, 4}));
}

TEST(read, gmsh_4_optional_sections) {
  const std::string text =
      "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Comments\nanything $Nodes\n$EndComments\n"
      "$PhysicalNames\n1\n2 5 \"grip\"\n$EndPhysicalNames\n"
      "$Entities\n0 0 1 1\n1 0 0 0 1 1 0 0 0\n1 0 0 0 1 1 1 0 1 1\n$EndEntities\n"
      "$PartitionedEntities\n2\n0\n0 0 1 1\n11 2 1 1 1 0 0 0 1 1 0 1 5 0\n21 3 1 2 1 2 0 0 0 1 1 1 1 8 0\n$EndPartitionedEntities\n"
      "$Nodes\n2 4 1 4\n2 11 1 3\n1\n2\n3\n0 0 0 .1 .2\n1 0 0 .3 .4\n0 1 0 .5 .6\n3 21 0 1\n4\n0 0 1\n$EndNodes\n"
      "$Elements\n2 2 1 2\n2 11 2 1\n1 1 2 3\n3 21 4 1\n2 1 2 3 4\n$EndElements\n"
      "$Periodic\n0\n$EndPeriodic\n$NodeData\n1\n\"T\"\n$EndNodeData\n";
  const TetMesh mesh = parse_mesh(std::as_bytes(std::span(text)), "parts.msh", MeshFormat::kGmsh);
  EXPECT_NEAR(calc_volume(mesh), 1.0 / 6.0, 1e-15);
  EXPECT_EQ(mesh.regions, std::vector<std::int32_t>{8});
  EXPECT_EQ(mesh.node_sets.at("grip"), (std::vector<std::int32_t>{0, 1, 2}));
}

TEST(read, gmsh_byte_order) {
  // Version 2.2 binary, written big-endian by hand.
  std::string text = "$MeshFormat\n2.2 1 8\n";
  const auto put = [&](auto value) {
    const auto* bytes = reinterpret_cast<const char*>(&value);
    for (std::size_t i = sizeof(value); i-- > 0;) text += bytes[i];
  };
  put(std::int32_t{1});
  text += "\n$EndMeshFormat\n$Nodes\n4\n";
  const double x[4][3] = {{0, 0, 0}, {2, 0, 0}, {0, 3, 0}, {0, 0, 4}};
  for (std::int32_t i = 0; i < 4; ++i) {
    put(std::int32_t{10 * i + 10});
    for (const double value : x[i]) put(value);
  }
  text += "\n$EndNodes\n$Elements\n1\n";
  for (const std::int32_t value : {4, 1, 2, 1, 5, 5, 10, 20, 30, 40}) put(value);
  text += "\n$EndElements\n";
  const TetMesh mesh = parse_mesh(std::as_bytes(std::span(text)), "big.msh", MeshFormat::kGmsh);
  EXPECT_DOUBLE_EQ(calc_volume(mesh), 4.0);
  EXPECT_EQ(mesh.regions.at(0), 5);
}

TEST(read, gmsh_periodic_mesh) {
  const TetMesh first = read_mesh(fixture("gmsh41_periodic_text_1.msh"));
  EXPECT_NEAR(calc_volume(first), 0.3 * 0.2 * 0.1, 1e-12);
  for (const char* name : {"gmsh41_periodic_binary_1.msh", "gmsh22_periodic_text_1.msh", "gmsh22_periodic_binary_1.msh"}) {
    SCOPED_TRACE(name);
    const TetMesh mesh = read_mesh(fixture(name));
    EXPECT_EQ(mesh.nodes_m.size(), first.nodes_m.size());
    EXPECT_EQ(mesh.tet_count(), first.tet_count());
    EXPECT_NEAR(calc_volume(mesh), 0.3 * 0.2 * 0.1, 1e-12);
  }
}

/// A binary section of values whose bytes are `bytes`, padded to entries of one value each.
std::string make_data(const std::string& name, std::string bytes, bool tag_on_a_line) {
  while (bytes.size() % 12 != 0) bytes += ' ';
  return "$" + name + "\n1\n\"a view\"\n1\n0\n3\n0\n1\n" + std::to_string(bytes.size() / 12) + "\n" + bytes + (tag_on_a_line ? "\n" : "") +
         "$End" + name + "\n";
}

TEST(read, gmsh_tags_in_binary_values) {
  const TetMesh plain = read_mesh(fixture("gmsh41_binary_1.msh"));
  const std::string hostile[] = {"\n$EndElementData\n$Nodes\n", "$EndElementData", "\n$EndNodeData\n", std::string(24, '\0'), ""};
  for (const char* version : {"gmsh41_binary_1.msh", "gmsh22_binary_1.msh"})
    for (const std::string& bytes : hostile)
      for (const char* name : {"ElementData", "NodeData"})
        for (const bool tag_on_a_line : {false, true}) {
          const std::string text =
              read_text(fixture(version)) + make_data(name, bytes, tag_on_a_line) + "$Comments\nno line end before the tag$EndComments\n";
          const TetMesh mesh = parse_mesh(std::as_bytes(std::span(text)), "views.msh", MeshFormat::kGmsh);
          EXPECT_EQ(mesh.tet_count(), plain.tet_count());
        }
  // Unknown or nonstandard sections end at a tag followed by another section or the end of the file.
  const std::string text =
      read_text(fixture("gmsh41_binary_1.msh")) + "$Foreign\n\x01\x02$EndForeign\x03\x04$EndForeign\n$Periodic\nodd$EndPeriodic";
  EXPECT_EQ(parse_mesh(std::as_bytes(std::span(text)), "views.msh", MeshFormat::kGmsh).tet_count(), plain.tet_count());
  const std::string cut = read_text(fixture("gmsh41_binary_1.msh")) + make_data("ElementData", std::string(48, 'x'), false).substr(0, 70);
  EXPECT_THROW(parse_mesh(std::as_bytes(std::span(cut)), "views.msh", MeshFormat::kGmsh), InputError);
}

TEST(read, truncated_files) {
  for (const auto& [file, format] : {std::pair{"gmsh22_text_1.msh", MeshFormat::kGmsh},
                                     {"gmsh22_binary_1.msh", MeshFormat::kGmsh},
                                     {"gmsh41_text_1.msh", MeshFormat::kGmsh},
                                     {"gmsh41_binary_1.msh", MeshFormat::kGmsh},
                                     {"medit_1.mesh", MeshFormat::kMedit},
                                     {"vtk_ascii_1.vtu", MeshFormat::kVtu},
                                     {"vtk_raw_zlib_1.vtu", MeshFormat::kVtu},
                                     {"vtk_appended_zlib64_1.vtu", MeshFormat::kVtu}}) {
    const std::string text = read_text(fixture(file));
    std::size_t refused = 0;
    for (std::size_t size = 0; size < text.size(); ++size) {
      try {
        const TetMesh mesh = parse_mesh(std::as_bytes(std::span(text).first(size)), file, format);
        EXPECT_EQ(mesh.tet_count(), 89) << file << " cut to " << size;
      } catch (const InputError& error) {
        ++refused;
        EXPECT_NE(std::string(error.what()).find(file), std::string::npos);
      }
    }
    // Only the last line end or the last keyword may be missing without loss.
    EXPECT_GE(refused + 8, text.size()) << file;
  }
}

}  // namespace
}  // namespace carillon::mesh
