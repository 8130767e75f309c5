// What every reader gathers, and how it becomes a TetMesh. Inner header of the readers.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "precompute/mesh/cursor.hpp"
#include "precompute/mesh/tet_mesh.hpp"

namespace carillon::mesh {

/// A mesh in the words of its file: nodes known by tags, elements by the tags of their nodes, everything with its place.
struct RawMesh {
  struct Reference {
    std::int64_t node_tag;
    std::size_t place;
  };
  std::vector<std::int64_t> node_tags;
  std::vector<std::size_t> node_places;
  std::vector<Vec3> nodes;

  int order = 0;                       // 0: no tetrahedron yet
  std::vector<std::int64_t> tets;      // node tags in the order of TetMesh
  std::vector<std::int64_t> tet_tags;  // what the file calls the element
  std::vector<std::size_t> tet_places;
  std::vector<std::int32_t> regions;

  std::map<std::string, std::vector<Reference>> node_sets;    // from nodes and surface elements
  std::map<std::string, std::vector<std::int64_t>> tet_sets;  // positions of tetrahedra whose nodes belong to the set
  std::map<std::string, std::int64_t> others;                 // plural name of an ignored kind -> how many

  /// Adds a node; InputError when a coordinate is not finite.
  void add_node(const Cursor& cursor, std::int64_t tag, const Vec3& x, std::size_t place);
  /// Adds a tetrahedron of 4 or 10 nodes, `file_position[i]` being where the file keeps our node i. InputError when orders mix.
  void add_tet(const Cursor& cursor, std::int64_t tag, const std::int64_t* tags, int node_count, const int* file_position,
               std::int32_t region, std::size_t place);
};

/// The places of our nodes 0..9 in a file of VTK's order and in one of Gmsh's.
inline constexpr int kVtkOrder[10] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9};
inline constexpr int kGmshOrder[10] = {0, 1, 2, 3, 4, 5, 6, 7, 9, 8};

/// Name of the physical group of region 0 (elements without a region) in a Gmsh file: other programs do not export volumes without a group.
inline constexpr const char* kNoRegionName = "carillon region 0";

/// Joins tetrahedra that repeat an earlier one, node by node, under another region. Returns the new position of every old one.
std::vector<std::int64_t> merge_repeated_tets(RawMesh& raw);

/// Turns tags into indices. Throws InputError: no nodes, no tetrahedra, a tag used twice, an element with a node that is not there.
/// `cursors`: element places are those of `elements`, node places those of `nodes` (the same file but for TetGen).
TetMesh build_mesh(RawMesh&& raw, const Cursor& nodes, const Cursor& elements);

/// Makes the sets `prefix:N` of one value per node (0 makes none); more than 1000 different values make none at all.
void add_value_sets(const std::string& prefix, const std::vector<std::int64_t>& values, std::size_t first_node, TetMesh& mesh);

TetMesh parse_gmsh(std::string_view bytes, const std::string& name);
TetMesh parse_medit(std::string_view bytes, const std::string& name);
TetMesh parse_vtu(std::string_view bytes, const std::string& name);
TetMesh parse_tetgen(std::string_view node_bytes, const std::string& node_name, std::string_view ele_bytes, const std::string& ele_name);

}  // namespace carillon::mesh
