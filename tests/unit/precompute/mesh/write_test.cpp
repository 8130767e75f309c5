// Round trip of written files: own reader, meshio, Gmsh.
#include "precompute/mesh/write.hpp"

#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>

#include "precompute/mesh/check.hpp"
#include "precompute/mesh/read.hpp"
#include "tests/support/paths.hpp"
#include "tests/unit/precompute/mesh/truth.hpp"

namespace carillon::mesh {
namespace {

class Written : public testing::TestWithParam<std::tuple<const char*, GmshEncoding>> {};

TEST_P(Written, gmsh_round_trip) {
  const auto& [file, encoding] = GetParam();
  const tests::Folder scratch;
  TetMesh mesh = read_mesh(fixture(file));
  EXPECT_TRUE(mesh.doubt_m.empty());
  mesh.doubt_m.assign(mesh.nodes_m.size(), Vec3{});
  for (std::size_t i = 0; i < mesh.nodes_m.size(); i += 3) mesh.doubt_m[i] = {1e-5 * static_cast<double>(i + 1), -0.25, 1.0 / 3};
  write_gmsh(mesh, scratch / "out.msh", encoding);
  const TetMesh back = read_mesh(scratch / "out.msh");
  EXPECT_EQ(back.order, mesh.order);
  EXPECT_EQ(back.nodes_m, mesh.nodes_m);
  EXPECT_EQ(back.doubt_m, mesh.doubt_m);
  EXPECT_EQ(back.tets, mesh.tets);
  EXPECT_EQ(back.regions, mesh.regions);
  for (const auto& [name, set] : mesh.node_sets) EXPECT_EQ(back.node_sets.at(name), set) << name;
}

/// Runs tests/unit/precompute/mesh/read_with_others.py; false when the reader is not installed.
bool read_with(const std::string& reader, const std::filesystem::path& file, std::string& said) {
  const std::string out = file.string() + ".said";
  const std::string command = std::string("/usr/bin/python3 ") + carillon::tests::get_source_dir() +
                              "/tests/unit/precompute/mesh/read_with_others.py " + reader + " " + file.string() + " > " + out + " 2>&1";
  const int status = std::system(command.c_str());
  said = read_text(out);
  return status == 0 || said.find("No module named") == std::string::npos;
}

/// Writes a mesh and reads it again: its regions, their names and its sets are those that it had.
void expect_same_again(const TetMesh& mesh, const std::filesystem::path& file) {
  write_gmsh(mesh, file);
  const TetMesh back = read_mesh(file);
  EXPECT_EQ(back.regions, mesh.regions);
  EXPECT_EQ(back.region_names, mesh.region_names);
  EXPECT_EQ(back.node_sets, mesh.node_sets);
}

TEST_P(Written, gmsh_file_in_meshio) {
  const auto& [file, encoding] = GetParam();
  const tests::Folder scratch;
  write_gmsh(read_mesh(fixture(file)), scratch / "out.msh", encoding);
  std::string said;
  if (!read_with("meshio", scratch / "out.msh", said)) GTEST_SKIP() << "meshio is not installed";
  EXPECT_NE(said.find("volume 0.006000 tets 89 mid-off 0"), std::string::npos) << said;
}

TEST_P(Written, gmsh_file_in_gmsh) {
  const auto& [file, encoding] = GetParam();
  const tests::Folder scratch;
  TetMesh mesh = read_mesh(fixture(file));
  mesh.doubt_m.assign(mesh.nodes_m.size(), Vec3{0, 0, 1e-3});  // arbitrary post-processing data
  write_gmsh(mesh, scratch / "out.msh", encoding);
  std::string said;
  if (!read_with("gmsh", scratch / "out.msh", said)) GTEST_SKIP() << "gmsh's Python module is not installed";
  EXPECT_NE(said.find("volume 0.006000 tets 89 mid-off 0"), std::string::npos) << said;
  const Truth truth = read_truth(read_mesh(fixture(file)).order);
  if (!std::string(file).starts_with("gmsh")) return;
  for (const char* set : {"clamp", "rim", "tip"}) {
    EXPECT_NE(said.find("set " + std::string(set) + " " + std::to_string(truth.groups.at(set).size())), std::string::npos) << said;
  }
}

INSTANTIATE_TEST_SUITE_P(fixtures, Written,
                         testing::Combine(testing::Values("gmsh41_text_1.msh", "gmsh41_binary_2.msh", "vtk_raw_1.vtu"),
                                          testing::Values(GmshEncoding::kBinary, GmshEncoding::kText)));

TEST(write, vtu_round_trip) {
  for (const char* file : {"gmsh41_text_1.msh", "gmsh41_binary_2.msh"}) {
    const tests::Folder scratch;
    TetMesh mesh = read_mesh(fixture(file));
    mesh.node_sets["a <b> & \"c\""] = {0, 5};
    mesh.node_sets["none"] = {};
    mesh.doubt_m.assign(mesh.nodes_m.size(), Vec3{1e-5, 0, 1.0 / 3});
    write_vtu(mesh, scratch / "out.vtu");
    const TetMesh back = read_mesh(scratch / "out.vtu");
    EXPECT_EQ(back.order, mesh.order);
    EXPECT_EQ(back.nodes_m, mesh.nodes_m);
    EXPECT_EQ(back.doubt_m, mesh.doubt_m);
    EXPECT_EQ(back.tets, mesh.tets);
    EXPECT_EQ(back.regions, mesh.regions);
    EXPECT_EQ(back.node_sets, mesh.node_sets);
  }
}

TEST(write, mesh_without_regions) {
  for (const char* file : {"vtk_raw_1.vtu", "gmsh41_binary_2.msh"}) {
    const tests::Folder scratch;
    TetMesh mesh = read_mesh(fixture(file));
    mesh.regions.assign(mesh.regions.size(), 0);
    mesh.region_names.clear();
    expect_same_again(mesh, scratch / "out.msh");
    std::string said;
    if (!read_with("meshio", scratch / "out.msh", said)) GTEST_SKIP() << "meshio is not installed";
    EXPECT_NE(said.find("volume 0.006000 tets 89 mid-off 0"), std::string::npos) << said;
    if (!read_with("gmsh", scratch / "out.msh", said)) GTEST_SKIP() << "gmsh's Python module is not installed";
    EXPECT_NE(said.find("exported 89"), std::string::npos) << said;
  }
}

TEST(write, named_regions) {
  TetMesh mesh = read_mesh(fixture("vtk_ascii_1.vtu"));
  for (std::size_t e = 0; e < mesh.regions.size(); ++e) mesh.regions[e] = static_cast<std::int32_t>(e % 3);  // 0, 1, 2
  mesh.region_names = {{1, "steel"}};
  mesh.node_sets.clear();
  const tests::Folder scratch;
  write_gmsh(mesh, scratch / "out.msh");
  const TetMesh once = read_mesh(scratch / "out.msh");
  EXPECT_EQ(once.regions, mesh.regions);
  EXPECT_EQ(once.region_names, mesh.region_names);
  ASSERT_EQ(once.node_sets.size(), 2u);  // nodes of its regions
  expect_same_again(once, scratch / "again.msh");
  std::string said;
  if (!read_with("meshio", scratch / "again.msh", said)) GTEST_SKIP() << "meshio is not installed";
  EXPECT_NE(said.find("group 1 30"), std::string::npos) << said;
  EXPECT_NE(said.find("group 3 30"), std::string::npos) << said;  // region 0, under an unused number
}

TEST(write, region_order) {
  TetMesh mesh = read_mesh(fixture("vtk_ascii_1.vtu"));
  for (std::size_t e = 0; e < mesh.regions.size(); ++e) mesh.regions[e] = static_cast<std::int32_t>(e % 3);
  mesh.node_sets = {{"two words", {3, 5}}, {"empty", {}}, {"overlap", {5, 6, 7}}};
  const tests::Folder scratch;
  write_gmsh(mesh, scratch / "out.msh");
  const TetMesh back = read_mesh(scratch / "out.msh");
  EXPECT_EQ(back.tets, mesh.tets);
  EXPECT_EQ(back.regions, mesh.regions);
  for (const auto& [name, set] : mesh.node_sets) EXPECT_EQ(back.node_sets.at(name), set) << name;
}

}  // namespace
}  // namespace carillon::mesh
