// Method: the two text files of TetGen; node numbers are arbitrary and looked up. Node attributes, .face, .edge and .neigh files are
//   ignored.
// Source: TetGen 1.5 manual, sections 5.2.1 (.node) and 5.2.4 (.ele). Mid-node order of -o2 as in the program's output
//   (tests/unit/precompute/mesh/data/box2.1.ele): edges 23, 03, 01, 12, 13, 02.

#include <cmath>

#include "precompute/mesh/build_mesh.hpp"

namespace carillon::mesh {

namespace {
constexpr int kTetgenOrder[10] = {0, 1, 2, 3, 6, 7, 9, 5, 8, 4};
}

TetMesh parse_tetgen(std::string_view node_bytes, const std::string& node_name, std::string_view ele_bytes, const std::string& ele_name) {
  RawMesh raw;
  Cursor node(node_bytes, node_name);
  node.set_comment('#');
  node.skip_space();
  const std::size_t node_head = node.place();
  const auto announced = node.text_int("the number of nodes", INT64_MIN, INT64_MAX);
  const auto dimension = node.text_int("the dimension", 0, 9);
  const auto attributes = node.text_int("the number of attributes", 0, 1000);
  const auto markers = node.text_int("the number of boundary markers", 0, 1000);
  if (dimension != 3) node.fail(node_head, "the nodes have {} coordinates; a body needs 3: write .node files of dimension 3", dimension);
  const auto count = node.checked_count(announced, 8, "nodes", node_head);
  raw.nodes.reserve(count);
  std::vector<std::int64_t> values;
  for (std::size_t i = 0; i < count; ++i) {
    node.skip_space();
    const std::size_t place = node.place();
    const auto tag = node.text_int("the number of a node", INT32_MIN, INT32_MAX);
    Vec3 x{};
    for (double& value : x) value = node.text_real("a coordinate");
    raw.add_node(node, tag, x, place);
    for (std::int64_t k = 0; k < attributes; ++k) node.text_real("an attribute of a node");
    for (std::int64_t k = 0; k < markers; ++k) {
      const auto marker = node.text_int("a boundary marker", INT32_MIN, INT32_MAX);
      if (k == 0) values.push_back(marker);
    }
  }
  if (node.skip_space()) node.fail(node.place(), "more than the {} nodes that the first line announces; correct that line", count);

  Cursor ele(ele_bytes, ele_name);
  ele.set_comment('#');
  ele.skip_space();
  const std::size_t ele_head = ele.place();
  const auto tets = ele.text_int("the number of tetrahedra", INT64_MIN, INT64_MAX);
  const auto corners = ele.text_int("the number of nodes of a tetrahedron", INT32_MIN, INT32_MAX);
  const auto region_count = ele.text_int("the number of region attributes", 0, 1000);
  if (corners != 4 && corners != 10)
    ele.fail(ele_head, "elements of {} nodes; only tetrahedra of 4 or 10 nodes are read: write those (TetGen -o1 or -o2)", corners);
  const auto tet_count = ele.checked_count(tets, 2 * corners + 2, "tetrahedra", ele_head);
  std::int64_t tags[10] = {};
  for (std::size_t i = 0; i < tet_count; ++i) {
    ele.skip_space();
    const std::size_t place = ele.place();
    const auto tag = ele.text_int("the number of a tetrahedron", INT32_MIN, INT32_MAX);
    for (std::int64_t k = 0; k < corners; ++k) tags[k] = ele.text_int("a node of a tetrahedron", INT32_MIN, INT32_MAX);
    std::int32_t region = 0;
    for (std::int64_t k = 0; k < region_count; ++k) {
      // TetGen's region attributes are real numbers; round to the nearest integer.
      const double value = ele.text_real("a region attribute");
      if (k == 0 && std::abs(value) < 2e9) region = static_cast<std::int32_t>(std::lround(value));
    }
    raw.add_tet(ele, tag, tags, static_cast<int>(corners), corners == 4 ? kVtkOrder : kTetgenOrder, region, place);
  }
  if (ele.skip_space()) ele.fail(ele.place(), "more than the {} tetrahedra that the first line announces; correct that line", tet_count);
  TetMesh mesh = build_mesh(std::move(raw), node, ele);
  add_value_sets("marker", values, 0, mesh);
  return mesh;
}

}  // namespace carillon::mesh
