// Method: keywords and numbers of an ASCII .mesh file; keywords other than nodes and elements are skipped. TetrahedraP2 without
//   TetrahedraP2Ordering has no agreed order: VTK order is assumed (as Gmsh reads it) unless Gmsh order brings the mid nodes nearer to the
//   edge midpoints. Gmsh 4.8 writes second order under first-order keywords with more numbers per line; rows of 11 numbers under Tetrahedra
//   are read that way (two first-order rows on a line would be 10).
// Source: INRIA technical report RT-0253 (P. Frey, "MEDIT", 2001), appendix on the .mesh format; TetrahedraP2 and TetrahedraP2Ordering as
//   in libMeshb 7.

#include <algorithm>
#include <array>
#include <cctype>
#include <optional>

#include "precompute/mesh/build_mesh.hpp"

namespace carillon::mesh {

namespace {

struct Section {
  int numbers;          // node numbers per row, without the reference
  const char* prefix;   // of the node sets; nullptr: none
  const char* plural;   // for messages
  bool volume = false;  // a solid element other than a tetrahedron
  int quadratic = 0;    // node numbers per row if Gmsh writes second order under this keyword
};

const std::map<std::string_view, Section>& sections() {
  static const std::map<std::string_view, Section> table{
      {"Edges", {2, "edges", "edges", false, 3}},
      {"EdgesP2", {3, "edges", "edges"}},
      {"Triangles", {3, "triangles", "triangles", false, 6}},
      {"TrianglesP2", {6, "triangles", "triangles"}},
      {"Quadrilaterals", {4, "quads", "quadrilaterals"}},
      {"QuadrilateralsQ2", {9, "quads", "quadrilaterals"}},
      {"Hexahedra", {8, nullptr, "hexahedra", true}},
      {"Hexaedra", {8, nullptr, "hexahedra", true}},
      {"HexahedraQ2", {27, nullptr, "hexahedra", true}},
      {"Prisms", {6, nullptr, "prisms", true}},
      {"PrismsP2", {18, nullptr, "prisms", true}},
      {"Pentahedra", {6, nullptr, "prisms", true}},
      {"Pyramids", {5, nullptr, "pyramids", true}},
      {"PyramidsP2", {14, nullptr, "pyramids", true}},
      {"TetrahedraP3", {20, nullptr, "tetrahedra of third order", true}},
      {"TetrahedraP4", {35, nullptr, "tetrahedra of fourth order", true}},
  };
  return table;
}

class MeditReader {
 public:
  MeditReader(std::string_view bytes, const std::string& name) : cursor_(bytes, name) { cursor_.set_comment('#'); }
  TetMesh read();

 private:
  std::size_t read_count(std::size_t min_bytes, const char* what) {
    const std::size_t place = cursor_.place();
    return cursor_.checked_count(cursor_.text_int("a count", INT64_MIN, INT64_MAX), min_bytes, what, place);
  }
  int count_line_numbers();
  void read_vertices();
  void read_tets(int node_count);
  void read_surface(const Section& section);
  void read_ordering();
  void skip_numbers();
  void order_mid_nodes();

  Cursor cursor_;
  RawMesh raw_;
  std::vector<std::int64_t> references_;
  std::optional<std::array<int, 10>> ordering_;  // file position of our node i
};

void MeditReader::read_vertices() {
  const auto count = read_count(8, "vertices");
  raw_.nodes.reserve(count);
  for (std::size_t i = 0; i < count; ++i) {
    cursor_.skip_space();
    const std::size_t place = cursor_.place();
    Vec3 x{};
    for (double& value : x) value = cursor_.text_real("a coordinate");
    raw_.add_node(cursor_, static_cast<std::int64_t>(i) + 1, x, place);
    references_.push_back(cursor_.text_int("the reference of a vertex", INT32_MIN, INT32_MAX));
  }
}

/// Words on the line of the first row of a list.
int MeditReader::count_line_numbers() {
  if (!cursor_.skip_space()) return 0;
  std::string_view line = cursor_.bytes().substr(cursor_.place());
  line = line.substr(0, line.find_first_of("\n#"));
  int words = 0;
  for (std::size_t i = 0; i < line.size(); ++i) {
    const auto blank = [&](std::size_t k) { return std::isspace(static_cast<unsigned char>(line[k])) != 0; };
    if (!blank(i) && (i == 0 || blank(i - 1))) ++words;
  }
  return words;
}

void MeditReader::read_tets(int node_count) {
  const auto count = read_count(2 * node_count + 2, "tetrahedra");
  if (count > 0 && count_line_numbers() == 11) node_count = 10;
  std::array<std::int64_t, 10> tags{};
  for (std::size_t i = 0; i < count; ++i) {
    cursor_.skip_space();
    const std::size_t place = cursor_.place();
    for (int k = 0; k < node_count; ++k) tags[k] = cursor_.text_int("a vertex of a tetrahedron", INT32_MIN, INT32_MAX);
    const auto region = static_cast<std::int32_t>(cursor_.text_int("the reference of a tetrahedron", INT32_MIN, INT32_MAX));
    raw_.add_tet(cursor_, static_cast<std::int64_t>(i) + 1, tags.data(), node_count, kVtkOrder, region, place);
  }
}

void MeditReader::read_surface(const Section& section) {
  const std::size_t start = cursor_.place();
  const auto count = read_count(2 * section.numbers + 2, section.plural);
  if (count > 0 && section.volume)
    cursor_.fail(start, "the mesh holds {} {}; only tetrahedra are read: mesh the volume with those", count, section.plural);
  if (count > 0) raw_.others[section.plural] += static_cast<std::int64_t>(count);
  std::size_t numbers = section.numbers;
  if (count > 0 && section.quadratic > 0 && count_line_numbers() == section.quadratic + 1) numbers = section.quadratic;
  std::vector<RawMesh::Reference> nodes(numbers);
  for (std::size_t i = 0; i < count; ++i) {
    cursor_.skip_space();
    const std::size_t place = cursor_.place();
    for (auto& node : nodes) node = {cursor_.text_int("a vertex of a surface element", INT32_MIN, INT32_MAX), place};
    const auto reference = cursor_.text_int("the reference of a surface element", INT32_MIN, INT32_MAX);
    if (reference == 0 || section.prefix == nullptr) continue;
    auto& set = raw_.node_sets[fmt::format("{}:{}", section.prefix, reference)];
    set.insert(set.end(), nodes.begin(), nodes.end());
  }
}

/// Ten rows of four barycentric coordinates in halves: a corner has one 2, an edge midpoint two 1s.
void MeditReader::read_ordering() {
  const std::size_t start = cursor_.place();
  if (read_count(2, "rows of the ordering") != 10) cursor_.fail(start, "TetrahedraP2Ordering needs ten rows; write the mesh again");
  std::array<int, 10> ordering{};
  ordering.fill(-1);
  for (int row = 0; row < 10; ++row) {
    std::array<std::int64_t, 4> weights{};
    for (auto& weight : weights) weight = cursor_.text_int("a barycentric number", 0, 2);
    for (int c = 0; c < 4; ++c)
      if (weights[c] == 2) ordering[c] = row;
    for (std::size_t e = 0; e < kEdges.size(); ++e)
      if (weights[kEdges[e][0]] == 1 && weights[kEdges[e][1]] == 1) ordering[4 + e] = row;
  }
  for (const int position : ordering)
    if (position < 0) cursor_.fail(start, "TetrahedraP2Ordering does not place every corner and edge; write the mesh again");
  ordering_ = ordering;
}

void MeditReader::skip_numbers() {
  while (cursor_.skip_space()) {
    const std::size_t place = cursor_.place();
    if (std::isalpha(static_cast<unsigned char>(cursor_.word("a word")[0])) != 0) {
      cursor_.seek(place);
      return;
    }
  }
}

void MeditReader::order_mid_nodes() {
  if (raw_.order != 2) return;
  const auto at = [&](std::int64_t tag) { return raw_.nodes[tag - 1]; };
  const auto known = [&](std::int64_t tag) { return tag >= 1 && tag <= static_cast<std::int64_t>(raw_.nodes.size()); };
  std::array<int, 10> order{};
  std::copy_n(kVtkOrder, 10, order.begin());
  if (ordering_) {
    order = *ordering_;
  } else {
    std::array<double, 2> distance{};
    for (std::size_t e = 0; e < raw_.tet_tags.size(); ++e) {
      const std::int64_t* tags = raw_.tets.data() + 10 * e;
      if (!std::all_of(tags, tags + 10, known)) return;  // build_mesh reports the unknown node
      for (std::size_t edge = 4; edge < 6; ++edge)
        for (std::size_t way = 0; way < 2; ++way) {
          const Vec3 a = at(tags[kEdges[edge][0]]), b = at(tags[kEdges[edge][1]]);
          const Vec3 m = at(tags[(way == 0 ? kVtkOrder : kGmshOrder)[4 + edge]]);
          for (std::size_t k = 0; k < 3; ++k) distance[way] += (m[k] - 0.5 * (a[k] + b[k])) * (m[k] - 0.5 * (a[k] + b[k]));
        }
    }
    if (distance[1] < distance[0]) std::copy_n(kGmshOrder, 10, order.begin());
  }
  for (std::size_t e = 0; e < raw_.tet_tags.size(); ++e) {
    std::array<std::int64_t, 10> tags{};
    std::copy_n(raw_.tets.begin() + static_cast<std::ptrdiff_t>(10 * e), 10, tags.begin());
    for (std::size_t i = 0; i < 10; ++i) raw_.tets[10 * e + i] = tags[order[i]];
  }
}

TetMesh MeditReader::read() {
  bool begun = false;
  while (cursor_.skip_space()) {
    const std::size_t place = cursor_.place();
    const std::string_view keyword = cursor_.word("a keyword");
    if (!begun && keyword != "MeshVersionFormatted")
      cursor_.fail(place, "a Medit file begins with MeshVersionFormatted, not with {}", quote_excerpt(keyword));
    if (keyword == "MeshVersionFormatted") {
      cursor_.text_int("the version", 0, 4);
      begun = true;
    } else if (keyword == "Dimension") {
      const auto dimension = cursor_.text_int("the dimension", 0, 9);
      if (dimension != 3) cursor_.fail(place, "the mesh has {} dimensions; a body needs 3: mesh the volume", dimension);
    } else if (keyword == "End") {
      break;
    } else if (keyword == "Vertices") {
      if (!raw_.nodes.empty()) cursor_.fail(place, "a second list of Vertices; keep one mesh in a file");
      read_vertices();
    } else if (keyword == "Tetrahedra" || keyword == "TetrahedraP2") {
      read_tets(keyword == "Tetrahedra" ? 4 : 10);
    } else if (keyword == "TetrahedraP2Ordering") {
      read_ordering();
    } else if (const auto found = sections().find(keyword); found != sections().end()) {
      read_surface(found->second);
    } else if (std::isalpha(static_cast<unsigned char>(keyword[0])) != 0) {
      skip_numbers();
    } else {
      cursor_.fail(place,
                   "expected a keyword such as Tetrahedra, found {}; the count of the list before it may be wrong: write the mesh again",
                   quote_excerpt(keyword));
    }
  }
  order_mid_nodes();
  TetMesh mesh = build_mesh(std::move(raw_), cursor_, cursor_);
  add_value_sets("ref", references_, 0, mesh);
  return mesh;
}

}  // namespace

TetMesh parse_medit(std::string_view bytes, const std::string& name) { return MeditReader(bytes, name).read(); }

}  // namespace carillon::mesh
