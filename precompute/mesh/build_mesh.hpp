// Raw mesh that every reader fills, and its conversion to a TetMesh. Internal header of the readers.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "precompute/mesh/cursor.hpp"
#include "precompute/mesh/tet_mesh.hpp"

namespace carillon::mesh {

/// Mesh in file terms: nodes by tag, elements by node tags, each with its position in the file.
struct RawMesh {
  struct Reference {
    std::int64_t node_tag;
    std::size_t place;
  };
  std::vector<std::int64_t> node_tags;
  std::vector<std::size_t> node_places;
  std::vector<Vec3> nodes;

  int order = 0;                       // 0: no tetrahedra yet
  std::vector<std::int64_t> tets;      // node tags in the order of TetMesh
  std::vector<std::int64_t> tet_tags;  // element numbers of the file
  std::vector<std::size_t> tet_places;
  std::vector<std::int32_t> regions;

  std::map<std::string, std::vector<Reference>> node_sets;    // from nodes and surface elements
  std::map<std::string, std::vector<std::int64_t>> tet_sets;  // tetrahedra whose nodes belong to the set
  std::map<std::string, std::int64_t> others;                 // plural name of an ignored element type -> count

  /// Adds a node; InputError when a coordinate is not finite.
  void add_node(const Cursor& cursor, std::int64_t tag, const Vec3& x, std::size_t place);
  /// Adds a tetrahedron of 4 or 10 nodes; `file_position[i]` is the position of our node i in the file. InputError for mixed orders.
  void add_tet(const Cursor& cursor, std::int64_t tag, const std::int64_t* tags, int node_count, const int* file_position,
               std::int32_t region, std::size_t place);
};

/// Positions of our nodes 0..9 in a file with VTK order and with Gmsh order.
inline constexpr int kVtkOrder[10] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9};
inline constexpr int kGmshOrder[10] = {0, 1, 2, 3, 4, 5, 6, 7, 9, 8};

/// Physical group of region 0 (elements without a region) in Gmsh files: other programs do not export volumes without a group.
inline constexpr const char* kNoRegionName = "carillon region 0";

/// Merges tetrahedra that repeat an earlier one node by node under another region. Returns the new index of every old one.
std::vector<std::int64_t> merge_repeated_tets(RawMesh& raw);

/// Turns tags into indices. Throws InputError: no nodes, no tetrahedra, duplicate tag, undefined node.
/// `elements` and `nodes` locate elements and nodes in messages (the same file except for TetGen).
TetMesh build_mesh(RawMesh&& raw, const Cursor& nodes, const Cursor& elements);

/// Creates the sets `prefix:N` from one value per node (0: none); no set at all above 1000 distinct values.
void add_value_sets(const std::string& prefix, const std::vector<std::int64_t>& values, std::size_t first_node, TetMesh& mesh);

TetMesh parse_gmsh(std::string_view bytes, const std::string& name);
TetMesh parse_medit(std::string_view bytes, const std::string& name);
TetMesh parse_vtu(std::string_view bytes, const std::string& name);
/// `origins`: files that the text was joined from.
TetMesh parse_inp(std::string_view bytes, const std::string& name, std::span<const base::TextOrigin> origins = {});
TetMesh parse_bdf(std::string_view bytes, const std::string& name, std::span<const base::TextOrigin> origins = {});
TetMesh parse_unv(std::string_view bytes, const std::string& name);
TetMesh parse_tetgen(std::string_view node_bytes, const std::string& node_name, std::string_view ele_bytes, const std::string& ele_name);

}  // namespace carillon::mesh
