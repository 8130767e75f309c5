// Invalid files, with the expected message: position, cause and remedy.
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <algorithm>

#include "precompute/mesh/read.hpp"
#include "runtime/base/error.hpp"
#include "tests/support/catch_message.hpp"
#include "tests/unit/precompute/mesh/truth.hpp"

namespace carillon::mesh {
namespace {

struct BadFile {
  const char* title;
  const char* name;
  std::string content;
  std::vector<const char*> words;
};

const std::string kHead2 = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n";
const std::string kHead4 = "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n";
const std::string kNodes2 = "$Nodes\n4\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n$EndNodes\n";
const std::string kTet2 = "$Elements\n1\n17 4 2 0 1 1 2 3 4\n$EndElements\n";
const std::string kMedit = "MeshVersionFormatted 2\nDimension 3\nVertices\n4\n0 0 0 0\n1 0 0 0\n0 1 0 0\n0 0 1 0\n";

std::string vtu(const std::string& root, const std::string& points, const std::string& connectivity, const std::string& type) {
  return "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\"" + root +
         ">\n<UnstructuredGrid>\n<Piece NumberOfPoints=\"4\" NumberOfCells=\"1\">\n<Points>\n<DataArray type=\"Float64\" "
         "NumberOfComponents=\"3\" format=\"ascii\">" +
         points + "</DataArray>\n</Points>\n<Cells>\n<DataArray type=\"Int64\" Name=\"connectivity\" format=\"ascii\">" + connectivity +
         "</DataArray>\n<DataArray type=\"Int64\" Name=\"offsets\" format=\"ascii\">4</DataArray>\n<DataArray type=\"UInt8\" "
         "Name=\"types\" "
         "format=\"ascii\">" +
         type + "</DataArray>\n</Cells>\n</Piece>\n</UnstructuredGrid>\n</VTKFile>\n";
}
const std::string kPoints = "0 0 0 1 0 0 0 1 0 0 0 1";

std::vector<BadFile> bad_files() {
  return {
      {"empty", "a.msh", "", {"a.msh: the file is empty", "write the mesh again"}},
      {"blank", "a.msh", " \n\n", {"a.msh:1", "only blanks"}},
      {"unknown", "a.dat", "hello world\n", {"a.dat:1", "not a mesh file", "hello world", "Medit"}},
      {"unknown_comment", "a.dat", "$ Created by Gmsh\nGRID,1\n", {"a.dat:1", "not a mesh file", "Created by Gmsh", "Medit"}},
      {"surface", "a.stl", "solid box\n", {"a surface", "carillon-mesh"}},
      {"legacy_vtk", "a.vtk", "# vtk DataFile Version 3.0\n", {"legacy VTK", ".vtu"}},
      {"missing_node",
       "a.msh",
       kHead2 + kNodes2 + "$Elements\n1\n17 4 2 0 1 1 2 3 999\n$EndElements\n",
       {"a.msh:13: element 17 refers to node 999, which the file does not define; write the mesh again with all nodes saved"}},
      {"twin_node", "a.msh", kHead2 + "$Nodes\n2\n1 0 0 0\n1 1 0 0\n$EndNodes\n" + kTet2, {"a.msh:7", "node 1 is defined a second time"}},
      {"twin_sparse_node",
       "a.msh",
       kHead2 + "$Nodes\n3\n1 0 0 0\n2000000 1 0 0\n1 1 0 0\n$EndNodes\n" + kTet2,
       {"a.msh:8", "node 1 is defined a second time"}},
      {"nan", "a.msh", kHead2 + "$Nodes\n1\n1 0 nan 0\n$EndNodes\n" + kTet2, {"a.msh:6", "node 1", "nan", "not all finite"}},
      {"infinite", "a.msh", kHead2 + "$Nodes\n1\n1 0 1e999 0\n$EndNodes\n" + kTet2, {"a.msh:6", "inf", "not all finite"}},
      {"word_for_number", "a.msh", kHead2 + "$Nodes\n1\n1 0 zero 0\n$EndNodes\n" + kTet2, {"a.msh:6", "expected a coordinate", "'zero'"}},
      {"hostile_count",
       "a.msh",
       kHead2 + "$Nodes\n999999999999\n1 0 0 0\n$EndNodes\n",
       {"a.msh:5", "announces 999999999999 nodes", "room for"}},
      {"negative_count", "a.msh", kHead2 + "$Nodes\n-7\n$EndNodes\n", {"announces -7 nodes"}},
      {"count_too_small", "a.msh", kHead2 + "$Nodes\n1\n1 0 0 0\n2 1 0 0\n$EndNodes\n", {"a.msh:7", "expected $EndNodes, found '2 1 0 0'"}},
      {"cut_short", "a.msh", kHead2 + "$Nodes\n4\n1 0 0 0\n2 1 0 0\n3 0 1", {"a.msh:5", "cut short"}},
      {"no_elements", "a.msh", kHead2 + kNodes2, {"without a section $Elements", "cut short"}},
      {"hexahedra",
       "a.msh",
       kHead2 + kNodes2 + "$Elements\n1\n1 5 2 0 1 1 2 3 4 1 2 3 4\n$EndElements\n",
       {"a.msh:13", "hexahedra", "only tetrahedra"}},
      {"unknown_type", "a.msh", kHead2 + kNodes2 + "$Elements\n1\n1 444 2 0 1 1 2 3 4\n$EndElements\n", {"a.msh:13", "element type 444"}},
      {"only_triangles",
       "a.msh",
       kHead2 + kNodes2 + "$Elements\n1\n1 2 2 0 1 1 2 3\n$EndElements\n",
       {"no tetrahedra", "1 triangles", "mesh the volume first"}},
      {"mixed_orders",
       "a.msh",
       kHead2 + kNodes2 + "$Elements\n2\n1 4 0 1 2 3 4\n2 11 0 1 2 3 4 1 2 3 4 1 2\n$EndElements\n",
       {"a.msh:14", "element 2 is a quadratic tetrahedron among linear ones"}},
      {"old_version", "a.msh", "$MeshFormat\n4 0 8\n$EndMeshFormat\n", {"a.msh:2", "Gmsh format 4", "-format msh41"}},
      {"first_version", "a.msh", "$NOD\n1\n1 0 0 0\n$ENDNOD\n", {"a.msh:1", "Gmsh format 1", "-format msh41"}},
      {"no_byte_order", "a.msh", "$MeshFormat\n4.1 1 8\nabcd\n$EndMeshFormat\n", {"a.msh: byte 20", "byte-order mark"}},
      {"block_sum",
       "a.msh",
       kHead4 + "$Nodes\n1 4 1 4\n3 1 0 2\n1\n2\n0 0 0\n1 0 0\n$EndNodes\n",
       {"a.msh:5", "announces 4 nodes, but its blocks hold 2"}},
      {"group_without_node",
       "a.msh",
       kHead2 + "$PhysicalNames\n1\n2 5 \"grip\"\n$EndPhysicalNames\n" + kNodes2 +
           "$Elements\n2\n1 2 2 5 1 1 2 77\n2 4 2 0 1 1 2 3 4\n$EndElements\n",
       {"a.msh:17", "'grip'", "node 77"}},
      {"medit_two_dimensions", "a.mesh", "MeshVersionFormatted 2\nDimension 2\n", {"a.mesh:2", "2 dimensions"}},
      {"medit_vertex_zero", "a.mesh", kMedit + "Tetrahedra\n1\n0 1 2 3 0\nEnd\n", {"a.mesh:11", "element 1 refers to node 0"}},
      {"medit_hexahedra", "a.mesh", kMedit + "Hexahedra\n1\n1 2 3 4 1 2 3 4 0\nEnd\n", {"a.mesh:9", "1 hexahedra", "only tetrahedra"}},
      {"medit_count", "a.mesh", kMedit + "Tetrahedra\n2\n1 2 3 4 0\nEnd\n", {"a.mesh:12", "a vertex of a tetrahedron", "'End'"}},
      {"vtu_cell_type", "a.vtu", vtu("", kPoints, "0 1 2 3", "14"), {"a.vtu:", "pyramids", "only tetrahedra"}},
      {"vtu_no_such_type", "a.vtu", vtu("", kPoints, "0 1 2 3", "200"), {"a.vtu:9", "cell 1 is of type 200"}},
      {"vtu_point", "a.vtu", vtu("", kPoints, "0 1 2 4", "10"), {"a.vtu:9", "cell 1 refers to point 4", "0 to 3"}},
      {"vtu_too_few", "a.vtu", vtu("", "0 0 0 1 0 0 0 1 0 0 0", "0 1 2 3", "10"), {"a.vtu:6", "needs 12 numbers", "11 at most"}},
      {"vtu_word",
       "a.vtu",
       vtu("", "0 0 0 1 0 0 0 1 0 0 0 one", "0 1 2 3", "10"),
       {"a.vtu:6", "number 12 of DataArray 'Points'", "missing or damaged"}},
      {"vtu_lz4",
       "a.vtu",
       vtu(" compressor=\"vtkLZ4DataCompressor\"", kPoints, "0 1 2 3", "10"),
       {"a.vtu:2", "vtkLZ4DataCompressor", "save with zlib or no compression"}},
      {"vtu_xml", "a.vtu", vtu("", kPoints, "0 1 2 3", "10").substr(0, 300), {"a.vtu:", "XML is damaged"}},
      {"vtu_kind", "a.vtu", "<VTKFile type=\"PolyData\">\n</VTKFile>\n", {"a.vtu:1", "'PolyData'", "UnstructuredGrid"}},
  };
}

class BadMesh : public testing::TestWithParam<BadFile> {};

TEST_P(BadMesh, refusal_message) {
  const tests::Folder scratch;
  write_text(scratch / GetParam().name, GetParam().content);
  tests::expect_error<InputError>({GetParam().words.begin(), GetParam().words.end()}, [&] { read_mesh(scratch / GetParam().name); });
}

INSTANTIATE_TEST_SUITE_P(table, BadMesh, testing::ValuesIn(bad_files()), [](const auto& info) { return std::string(info.param.title); });

std::string refusal(const std::filesystem::path& file) {
  return tests::catch_message<InputError>([&] { read_mesh(file); });
}

TEST(bad_files, not_a_regular_file) {
  const tests::Folder scratch;
  ASSERT_EQ(::mkfifo((scratch / "pipe.msh").c_str(), 0600), 0);
  std::filesystem::create_directory(scratch / "folder.msh");
  for (const std::filesystem::path& file :
       {scratch / "pipe.msh", scratch / "folder.msh", std::filesystem::path("/dev/zero"), scratch / "none.msh"})
    EXPECT_NE(refusal(file).find(file.string()), std::string::npos) << refusal(file);
}

TEST(bad_files, tetgen_pairs) {
  const tests::Folder scratch;
  const std::string nodes = "4 3 0 0\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n";
  const auto attempt = [&](const std::string& node, const std::string& ele) {
    write_text(scratch / "t.node", node);
    write_text(scratch / "t.ele", ele);
    return refusal(scratch / "t.ele");
  };
  EXPECT_EQ(attempt(nodes, "1 4 0\n1 1 2 3 4\n"), "");
  EXPECT_NE(attempt(nodes, "1 4 0\n1 1 2 3 9\n").find("t.ele:2: element 1 refers to node 9"), std::string::npos);
  EXPECT_NE(attempt(nodes, "1 8 0\n1 1 2 3 4\n").find("t.ele:1: elements of 8 nodes"), std::string::npos);
  EXPECT_NE(attempt("4 2 0 0\n1 0 0\n", "1 4 0\n1 1 2 3 4\n").find("t.node:1: the nodes have 2 coordinates"), std::string::npos);
  EXPECT_NE(attempt("99999999 3 0 0\n1 0 0 0\n", "1 4 0\n1 1 2 3 4\n").find("t.node:1: the file announces 99999999 nodes"),
            std::string::npos);
  EXPECT_NE(
      attempt("4 3 0 0\n1 0 0 0\n2 1 0 0\n2 0 1 0\n4 0 0 1\n", "1 4 0\n1 1 2 3 4\n").find("t.node:4: node 2 is defined a second time"),
      std::string::npos);
  EXPECT_NE(attempt(nodes + "5 1 1 1\n", "1 4 0\n1 1 2 3 4\n").find("t.node:6: more than the 4 nodes"), std::string::npos);
  std::filesystem::remove(scratch / "t.node");
  EXPECT_NE(refusal(scratch / "t.ele").find("t.node"), std::string::npos);
}

TEST(bad_files, lz4_vtu) { EXPECT_NE(refusal(fixture("lz4.vtu")).find("save with zlib or no compression"), std::string::npos); }

TEST(bad_files, damaged_binary_data) {
  std::string text = read_text(fixture("gmsh41_binary_1.msh"));
  const auto elements = text.find("$Elements\n") + 10;
  text[elements + 7] = '\x7f';  // the count of blocks becomes enormous
  tests::expect_error<InputError>({"b.msh: byte " + std::to_string(elements)},
                                  [&] { parse_mesh(std::as_bytes(std::span(text)), "b.msh", MeshFormat::kGmsh); });
}

TEST(bad_files, damaged_zlib_block) {
  std::string text = read_text(fixture("vtk_raw_zlib_1.vtu"));
  const auto data = text.find('_', text.find("<AppendedData"));
  for (std::size_t i = data + 60; i < data + 80; ++i) text[i] = static_cast<char>(~text[i]);
  EXPECT_THROW(parse_mesh(std::as_bytes(std::span(text)), "z.vtu", MeshFormat::kVtu), InputError);
}

}  // namespace
}  // namespace carillon::mesh
