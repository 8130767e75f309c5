// Reference data of the fixtures from Gmsh's API (tests/unit/precompute/mesh/make_fixtures.py), and this reader's meshes in the same form.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "precompute/mesh/tet_mesh.hpp"
#include "tests/support/folder.hpp"

namespace carillon::mesh {

struct Truth {
  std::size_t nodes = 0;
  std::vector<std::vector<Vec3>> tets;              // the nodes of each, sorted; the elements sorted
  std::map<std::string, std::vector<Vec3>> groups;  // sorted
};

std::filesystem::path fixture(const std::string& name);
Truth read_truth(int order);

/// The mesh without its numbering.
std::vector<std::vector<Vec3>> place_tets(const TetMesh& mesh);
std::vector<Vec3> place_nodes(const TetMesh& mesh, const std::vector<std::int32_t>& nodes);

/// Largest distance between corresponding points of two lists.
double find_distance(const std::vector<Vec3>& a, const std::vector<Vec3>& b);

double calc_volume(const TetMesh& mesh);  // signed, by the divergence theorem over each element's faces

void write_text(const std::filesystem::path& file, const std::string& text);
std::string read_text(const std::filesystem::path& file);

}  // namespace carillon::mesh
