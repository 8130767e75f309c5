// CAE files: sets, sections, materials, units and supports; what is refused, and with which words; files cut at every byte.
#include <gtest/gtest.h>

#include <filesystem>

#include "precompute/mesh/check.hpp"
#include "precompute/mesh/read.hpp"
#include "runtime/base/error.hpp"
#include "tests/unit/precompute/mesh/truth.hpp"

namespace carillon::mesh {
namespace {

const std::string kNodes = "*NODE\n1, 0, 0, 0\n2, 1, 0, 0\n3, 0, 1, 0\n4, 0, 0, 1\n5, 1., 1.D0, 1\n";
const std::string kTets = "*ELEMENT, TYPE=C3D4, ELSET=All\n10, 1, 2, 3, 4\n11, 5, 4, 3,\n2\n";
const std::string kSteel = "*MATERIAL, NAME=Steel\n*ELASTIC\n2.1E+05, 0.3\n*DENSITY\n7.85E-09\n*SOLID SECTION, ELSET=All, MATERIAL=steel\n";
const std::string kStep = "*STEP\n*FREQUENCY\n10\n*END STEP\n";

TetMesh parse(const std::string& text, MeshFormat format, const std::string& name) {
  return parse_mesh(std::as_bytes(std::span(text)), name, format);
}
TetMesh parse_inp_text(const std::string& text) { return parse(text, MeshFormat::kInp, "a.inp"); }

TEST(inp, sets_sections_units_supports) {
  const TetMesh mesh =
      parse_inp_text("** by hand\n*Heading\n any text\n" + kNodes + kTets +
                     "*NSET, NSET=Root, GENERATE\n1, 3, 2\n*NSET, NSET=Both\nROOT, 5\n*ELSET, ELSET=\"One of them\"\n11\n" + kSteel +
                     "*BOUNDARY\n\"root\", 1, 3\n5, 2\n2, ENCASTRE\n" + kStep);
  EXPECT_EQ(mesh.order, 1);
  EXPECT_EQ(mesh.tet_count(), 2);
  EXPECT_EQ(mesh.nodes_m[4], (Vec3{1, 1, 1}));
  EXPECT_EQ(mesh.node_sets.at("Root"), (std::vector<std::int32_t>{0, 2}));
  EXPECT_EQ(mesh.node_sets.at("Both"), (std::vector<std::int32_t>{0, 2, 4}));
  EXPECT_EQ(mesh.node_sets.at("One of them"), (std::vector<std::int32_t>{1, 2, 3, 4}));
  EXPECT_EQ(mesh.node_sets.at("*BOUNDARY"), (std::vector<std::int32_t>{0, 1, 2}));
  EXPECT_EQ(mesh.supports, "*BOUNDARY");
  ASSERT_EQ(mesh.remarks.size(), 1U);  // node 5 is held in y only
  EXPECT_NE(mesh.remarks[0].find("held in y only"), std::string::npos) << mesh.remarks[0];
  EXPECT_EQ(mesh.unit_m, 1e-3);
  ASSERT_EQ(mesh.materials.size(), 1U);
  const FileMaterial& steel = mesh.materials.begin()->second;
  EXPECT_EQ(steel.problem, "");
  EXPECT_NEAR(steel.density_kg_m3, 7850, 1e-9);
  EXPECT_NEAR(steel.young_modulus_pa, 2.1e11, 1e-3);
  EXPECT_EQ(mesh.region_names.at(mesh.regions[0]), "All");
}

TEST(inp, smallest_set_is_the_region_without_sections) {
  const TetMesh mesh = parse_inp_text(kNodes + kTets + "*ELSET, ELSET=Half\n11\n** end\n");
  EXPECT_EQ(mesh.region_names.at(mesh.regions[0]), "All");
  EXPECT_EQ(mesh.region_names.at(mesh.regions[1]), "Half");
  EXPECT_EQ(mesh.unit_m, 1.0);
}

TEST(inp, node_sets_of_element_sets) {
  const std::string sets = "*ELSET, ELSET=Half, INTERNAL, INSTANCE=Part-1-1\n11\n*ELSET, ELSET=Edge, GENERATE, INTERNAL\n20, 20\n";
  const TetMesh mesh =
      parse_inp_text(kNodes + kTets + "*ELEMENT, TYPE=T3D2\n20, 1, 5\n" + "*NSET, NSET=Late, ELSET=half, INTERNAL\n" + sets +
                     "*NSET, ELSET=Edge, NSET=Bar\n*NSET, NSET=Spelled, UNSORTED\n5, 2, 4,\n3\n*NSET, NSET=Joined\nBar, 2\n" +
                     "*NSET, NSET=Bar, UNSORTED, INTERNAL, GENERATE\n3, 3, 1\n*NSET, NSET=Whole, ELSET=ALL\n");
  EXPECT_EQ(mesh.node_sets.at("Spelled"), (std::vector<std::int32_t>{1, 2, 3, 4}));
  EXPECT_EQ(mesh.node_sets.at("Late"), mesh.node_sets.at("Spelled"));
  EXPECT_EQ(mesh.node_sets.at("Bar"), (std::vector<std::int32_t>{0, 2, 4}));
  EXPECT_EQ(mesh.node_sets.at("Joined"), (std::vector<std::int32_t>{0, 1, 2, 4}));
  EXPECT_EQ(mesh.node_sets.at("Whole"), (std::vector<std::int32_t>{0, 1, 2, 3, 4}));
}

TEST(inp, units_of_inch_and_metre) {
  const auto with = [&](const std::string& young, const std::string& density) {
    return parse_inp_text(kNodes + kTets + "*MATERIAL, NAME=M\n*DENSITY\n" + density + "\n*ELASTIC\n" + young +
                          ", .3\n*SOLID SECTION, MATERIAL=M, ELSET=ALL\n");
  };
  const TetMesh inch = with("3.0457925e7", "7.345e-4");
  EXPECT_EQ(inch.unit_m, 0.0254);
  EXPECT_NEAR(inch.materials.at(1).young_modulus_pa, 2.1e11, 1e6);
  EXPECT_NEAR(inch.materials.at(1).density_kg_m3, 7849.5, 1.0);
  EXPECT_EQ(with("2.1e11", "7850").unit_m, 1.0);
  EXPECT_NE(with("210", "7.85e-6").materials.at(1).problem.find("density is 7.85e-06"), std::string::npos);
}

TEST(inp, included_files_are_named) {
  const tests::Folder scratch;
  std::filesystem::create_directory(scratch / "parts");
  write_text(scratch / "a.inp", "*HEADING\n*include, input=\"parts/nodes.inc\"\n" + kTets + "** end\n");
  write_text(scratch / "parts" / "nodes.inc", kNodes);
  EXPECT_EQ(read_mesh(scratch / "a.inp").tet_count(), 2);
  const auto refusal = [&] {
    try {
      read_mesh(scratch / "a.inp");
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  write_text(scratch / "parts" / "nodes.inc", kNodes + "6, 1, nonsense, 0\n");
  EXPECT_NE(refusal().find("nodes.inc:7: expected a coordinate"), std::string::npos) << refusal();
  write_text(scratch / "parts" / "nodes.inc", kNodes);
  write_text(scratch / "a.inp", "*HEADING\n*INCLUDE, INPUT=parts/nodes.inc\n" + kTets + "12, 1, 2, 3, 99\n");
  EXPECT_NE(refusal().find("a.inp:7: element 12 refers to node 99"), std::string::npos) << refusal();
  write_text(scratch / "parts" / "nodes.inc", "*INCLUDE, INPUT=../a.inp\n");
  EXPECT_NE(refusal().find("nodes.inc:1"), std::string::npos) << refusal();
  EXPECT_NE(refusal().find("by itself"), std::string::npos) << refusal();
  std::filesystem::remove(scratch / "parts" / "nodes.inc");
  EXPECT_NE(refusal().find("a.inp:2: the included file cannot be read"), std::string::npos) << refusal();
}

struct Refused {
  const char* title;
  std::string content;
  const char* words;
};

TEST(inp, refused) {
  for (const auto& [title, content, words] : std::vector<Refused>{
           {"hexahedra", kNodes + "*ELEMENT, TYPE=C3D8\n1, 1, 2, 3, 4, 5, 1, 2, 3\n", "a.inp:8: the mesh holds hexahedra (C3D8)"},
           {"no_keyword", "1, 2, 3\n", "a.inp:1: expected a keyword"},
           {"missing_node", kNodes + "*ELEMENT, TYPE=C3D4\n1, 1, 2, 3, 9\n**\n", "a.inp:8: element 1 refers to node 9"},
           {"short_element", kNodes + "*ELEMENT, TYPE=C3D10\n1, 1, 2, 3, 4\n", "a.inp:8: element 1 has 4 nodes, but a C3D10 has 10"},
           {"word", "*NODE\n1, 0, zero, 0\n", "a.inp:2: expected a coordinate (a number), found 'zero'"},
           {"no_type", kNodes + "*ELEMENT\n1, 1, 2, 3, 4\n", "a.inp:7: *ELEMENT without TYPE"},
           {"unknown_set", kNodes + kTets + "*BOUNDARY\nRout, 1, 3\n", "a.inp:12: there is no node set 'Rout'"},
           {"unknown_element", kNodes + kTets + "*ELSET, ELSET=A\n77\n", "a.inp:12: the set 'A' names element 77"},
           {"circle", kNodes + kTets + "*NSET, NSET=A\nB\n*NSET, NSET=B\nA\n", "is part of itself"},
           {"no_such_elements", kNodes + kTets + "*NSET, NSET=A, ELSET=Rest\n", "a.inp:11: there is no element set 'Rest'"},
           {"nodes_beside_elements", kNodes + kTets + "*NSET, NSET=A, ELSET=All\n1, 2\n", "a.inp:12: *NSET with ELSET takes the nodes"},
           {"backwards", kNodes + kTets + "*NSET, NSET=A, GENERATE\n5, 1, 1\n", "a.inp:12: GENERATE from 5 to 1"},
           {"transform", kNodes + kTets + "*TRANSFORM, NSET=A\n1,0,0,0,1,0\n", "a.inp:11: *TRANSFORM is not read"},
           {"orientation", kNodes + kTets + "*ORIENTATION, NAME=A\n1,0,0,0,1,0\n", "a.inp:11: *ORIENTATION is not read"},
           {"cylindrical", "*NODE, SYSTEM=C\n1, 0, 0, 0\n", "a.inp:1: *NODE with SYSTEM=C"},
           {"twice", kNodes + kTets + "*ELEMENT, TYPE=C3D4\n10, 1, 2, 3, 5\n**\n", "a.inp:12: element 10 is defined a second time"},
           {"two_parts", "*PART, NAME=A\n*PART, NAME=B\n", "a.inp:2: a second *PART"},
           {"two_systems", kNodes + kTets + kSteel + "*MATERIAL, NAME=B\n*DENSITY\n2700\n", "write the file in one system of units"},
           {"two_sections", kNodes + kTets + kSteel + "*MATERIAL, NAME=B\n*ELSET, ELSET=C\n10\n*SOLID SECTION, ELSET=C, MATERIAL=B\n",
            "a.inp:20: element 10 has the material 'STEEL' by another section"},
           {"no_end_step", kNodes + kTets + "*STEP\n*FREQUENCY\n10\n", "a.inp:11: this *STEP has no *END STEP"},
           {"no_line_end", kNodes + kTets + "*STEP", "the file ends within a line"},
           {"no_tets", kNodes, "the file has no tetrahedra"},
           {"include", "*INCLUDE, INPUT=a\n", "a.inp:1: *INCLUDE cannot be followed here"}}) {
    try {
      parse_inp_text(content);
      ADD_FAILURE() << title << " was read";
    } catch (const InputError& error) {
      EXPECT_NE(std::string(error.what()).find(words), std::string::npos) << title << ": " << error.what();
    }
  }
}

TEST(inp, unusable_materials_say_why) {
  const auto problem = [&](const std::string& material) {
    return parse_inp_text(kNodes + kTets + material + "*SOLID SECTION, ELSET=ALL, MATERIAL=A\n").materials.at(1).problem;
  };
  EXPECT_NE(problem("").find("a.inp:11: the material 'A' of this section is not defined"), std::string::npos);
  EXPECT_NE(problem("*MATERIAL, NAME=A\n*ELASTIC\n1e11, .3\n").find("a.inp:11: material 'A': it has no density"), std::string::npos);
  EXPECT_NE(problem("*MATERIAL, NAME=A\n*DENSITY\n7850\n").find("no isotropic elasticity"), std::string::npos);
  EXPECT_NE(problem("*MATERIAL, NAME=A\n*DENSITY\n7850\n*ELASTIC\n1e11, .3, 20\n9e10, .3, 300\n").find("depends on temperature"),
            std::string::npos);
  EXPECT_NE(problem("*MATERIAL, NAME=A\n*DENSITY\n7850\n*ELASTIC, TYPE=ORTHO\n1,2,3,4,5,6,7,8\n9\n").find("\"orthotropic\""),
            std::string::npos);
  EXPECT_NE(problem("*MATERIAL, NAME=A\n*DENSITY\n7850\n*ELASTIC\n1e11, .5\n").find("between -1 and 0.5"), std::string::npos);
}

const std::string kBdf =
    "SOL 103\nCEND\nSPC = 2\nBEGIN BULK\n$ comment\n"
    "GRID           1              0.      0.      0.\nGRID,2,,1.,0.,0.\n"
    "GRID*                  3                              0.              1.\n*                     0.\n"
    "GRID           4              0.      0.     1.0\nGRID           5            1.+0   10.-1      1.\n"
    "CTETRA        10       1       1       2       3       4\nCTETRA        11       2       5       4       3       2\n"
    "PSOLID         1       3\nPSOLID         2       4\nMAT1,3,2.1+5,,0.3,7.85-9,,,0.002\nMAT1           4   7.0+4  2.63+4           "
    "2.7-9\n"
    "SPC1           1     123       4\nSPC1,2,123456,1,THRU,3\nRBE2,9,1,123,2\nENDDATA\n";

TEST(bdf, cards) {
  const TetMesh mesh = parse(kBdf, MeshFormat::kBdf, "a.bdf");
  EXPECT_EQ(mesh.tet_count(), 2);
  EXPECT_EQ(mesh.nodes_m[4], (Vec3{1, 1, 1}));
  EXPECT_EQ(mesh.nodes_m[2], (Vec3{0, 1, 0}));
  EXPECT_EQ(mesh.node_sets.at("SPC"), (std::vector<std::int32_t>{0, 1, 2}));
  EXPECT_EQ(mesh.node_sets.at("SPC 1"), (std::vector<std::int32_t>{3}));
  EXPECT_EQ(mesh.regions, (std::vector<std::int32_t>{1, 2}));
  EXPECT_EQ(mesh.unit_m, 1e-3);
  EXPECT_NEAR(mesh.materials.at(1).young_modulus_pa, 2.1e11, 1e-3);
  EXPECT_EQ(mesh.materials.at(1).loss_factor, 0.002);
  EXPECT_NEAR(mesh.materials.at(2).poisson_ratio, 7.0 / 5.26 - 1.0, 1e-12);
  ASSERT_EQ(mesh.remarks.size(), 1U);
  EXPECT_NE(mesh.remarks[0].find("a.bdf:20: RBE2 is left out"), std::string::npos) << mesh.remarks[0];
}

TEST(bdf, free_fields_of_long_lines_and_of_large_cards) {
  std::string text = kBdf;
  const auto replace = [&](const std::string& old, const std::string& now) { text.replace(text.find(old), old.size(), now); };
  replace("GRID,2,,1.,0.,0.\n", "GRID*,2,,1.,0.,*A\n*A,0.\n");
  replace("MAT1,3,2.1+5,,0.3,7.85-9,,,0.002\n", "MAT1*,3,2.1+5,,0.3\n*,7.85-9,,,0.002\n");
  replace("SPC1,2,123456,1,THRU,3\n", "SPC1,2,123456,1,2,3,1,2,3,1,2,3,1,2,5\n");
  const TetMesh whole = parse(kBdf, MeshFormat::kBdf, "a.bdf"), mesh = parse(text, MeshFormat::kBdf, "a.bdf");
  EXPECT_EQ(mesh.nodes_m, whole.nodes_m);
  EXPECT_EQ(mesh.materials.at(1).density_kg_m3, whole.materials.at(1).density_kg_m3);
  EXPECT_EQ(mesh.materials.at(1).loss_factor, 0.002);
  EXPECT_EQ(mesh.node_sets.at("SPC"), (std::vector<std::int32_t>{0, 1, 2, 4}));
}

TEST(bdf, refused) {
  const std::string grids = "GRID,1,,0.,0.,0.\nGRID,2,,1.,0.,0.\nGRID,3,,0.,1.,0.\nGRID,4,,0.,0.,1.\n";
  for (const auto& [title, content, words] :
       std::vector<Refused>{{"system", "GRID,1,5,0.,0.,0.\nENDDATA\n", "a.bdf:1: node 1 is in coordinate system 5"},
                            {"hexa", grids + "CHEXA,1,1,1,2,3,4,1,2\nENDDATA\n", "a.bdf:5: the mesh holds hexahedra"},
                            {"five", grids + "CTETRA,1,1,1,2,3,4,1\nENDDATA\n", "a.bdf:5: CTETRA 1 has 5 nodes"},
                            {"no_end", grids + "CTETRA,1,1,1,2,3,4\n", "ends without ENDDATA"},
                            {"word", "GRID,1,,0.,x,0.\nENDDATA\n", "a.bdf:1: expected a coordinate"},
                            {"directions", grids + "CTETRA,1,1,1,2,3,4\nSPC1,1,789,1\nENDDATA\n", "a.bdf:6: expected directions"}}) {
    try {
      parse(content, MeshFormat::kBdf, "a.bdf");
      ADD_FAILURE() << title << " was read";
    } catch (const InputError& error) {
      EXPECT_NE(std::string(error.what()).find(words), std::string::npos) << title << ": " << error.what();
    }
  }
}

const std::string kUnv =
    "    -1\n   164\n         5mm milli-newton              2\n  1.0D+03  1.0D+03  1.0D+00\n  2.7D+02\n    -1\n"
    "    -1\n  2411\n         1         1         1        11\n  0. 0. 0.\n         2         1         1        11\n  1.0D+00 0. 0.\n"
    "         3         1         1        11\n  0. 1. 0.\n         4         1         1        11\n  0. 0. 1.\n    -1\n"
    "    -1\n  2412\n         7        11         1         1         7         2\n         0         1         1\n         1         2\n"
    "        10       111         3         1         7         4\n         1         2         3         4\n    -1\n"
    "    -1\n  2467\n         1         0         0         0         0         0         0         3\nroot\n"
    "         7         1         0         0         7         3         0         0\n         7         4         0         0\n"
    "         2         0         0         0         0         0         0         1\nbody\n         8        10         0         0\n    "
    "-1\n";

TEST(unv, datasets) {
  const TetMesh mesh = parse(kUnv, MeshFormat::kUnv, "a.unv");
  EXPECT_EQ(mesh.tet_count(), 1);
  EXPECT_EQ(mesh.unit_m, 1e-3);
  EXPECT_EQ(mesh.node_sets.at("root"), (std::vector<std::int32_t>{0, 2, 3}));
  EXPECT_EQ(mesh.region_names.at(mesh.regions[0]), "body");
}

TEST(unv, refused) {
  const auto with = [](const std::string& from, const std::string& to) {
    std::string text = kUnv;
    return text.replace(text.find(from), from.size(), to);
  };
  for (const auto& [title, content, words] : std::vector<Refused>{
           {"hexa", with("       111         3         1         7         4", "       115         3         1         7         8"),
            "a.unv:23: the mesh holds hexahedra"},
           {"count", with("         7         4\n", "         7 999999999\n"), "a.unv:23: element 10 announces 999999999 nodes"},
           {"word", with("  0. 1. 0.", "  0. one 0."), "a.unv:14: expected a coordinate"},
           {"junk", "hello\n", "a.unv:1: expected a line -1"},
           {"unit", with("  1.0D+03  1.0D+03", "  0.0D+00  1.0D+03"), "a.unv:4: the factor of lengths is 0"}}) {
    try {
      parse(content, MeshFormat::kUnv, "a.unv");
      ADD_FAILURE() << title << " was read";
    } catch (const InputError& error) {
      EXPECT_NE(std::string(error.what()).find(words), std::string::npos) << title << ": " << error.what();
    }
  }
}

/// A file that was cut is refused by name, or it still has every node and tetrahedron.
void expect_cuts_named(const std::string& text, MeshFormat format, std::size_t nodes, std::int64_t tets) {
  for (std::size_t cut = 1; cut < text.size(); ++cut) {
    try {
      const TetMesh mesh = parse(text.substr(0, cut), format, "cut");
      EXPECT_EQ(mesh.nodes_m.size(), nodes) << cut;
      EXPECT_EQ(mesh.tet_count(), tets) << cut;
    } catch (const InputError& error) {
      EXPECT_EQ(std::string(error.what()).find("cut"), 0U) << error.what();
    }
  }
}

TEST(cae, cut_at_every_byte) {
  expect_cuts_named(kNodes + kTets + kSteel + kStep, MeshFormat::kInp, 5, 2);
  expect_cuts_named(kBdf, MeshFormat::kBdf, 5, 2);
  expect_cuts_named(kUnv, MeshFormat::kUnv, 4, 1);
}

}  // namespace
}  // namespace carillon::mesh
