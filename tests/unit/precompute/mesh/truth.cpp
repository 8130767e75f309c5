#include "tests/unit/precompute/mesh/truth.hpp"

#include <stdlib.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <iterator>
#include <stdexcept>

#include "tests/support/paths.hpp"

namespace carillon::mesh {

namespace {
// Coordinates that differ in the last digits must sort alike: they are rounded to a picometre first.
Vec3 rounded(const Vec3& x) {
  return {std::round(x[0] * 1e12) * 1e-12 + 0.0, std::round(x[1] * 1e12) * 1e-12 + 0.0, std::round(x[2] * 1e12) * 1e-12 + 0.0};
}
}  // namespace

std::filesystem::path fixture(const std::string& name) {
  return std::filesystem::path(carillon::tests::get_source_dir()) / "tests/unit/precompute/mesh/data" / name;
}

Truth read_truth(int order) {
  std::ifstream in(fixture("truth" + std::to_string(order) + ".txt"));
  Truth truth;
  std::size_t count = 0, width = 0;
  in >> truth.nodes >> count >> width;
  const auto read_points = [&](std::size_t n) {
    std::vector<Vec3> points(n);
    for (auto& x : points) {
      in >> x[0] >> x[1] >> x[2];
      x = rounded(x);
    }
    std::sort(points.begin(), points.end());
    return points;
  };
  for (std::size_t e = 0; e < count; ++e) truth.tets.push_back(read_points(width));
  std::sort(truth.tets.begin(), truth.tets.end());
  std::string name;
  std::size_t size = 0;
  while (in >> name >> size) truth.groups[name] = read_points(size);
  if (truth.tets.empty()) throw std::runtime_error("no truth");
  return truth;
}

std::vector<std::vector<Vec3>> place_tets(const TetMesh& mesh) {
  std::vector<std::vector<Vec3>> tets;
  for (std::int64_t e = 0; e < mesh.tet_count(); ++e) tets.push_back(place_nodes(mesh, {mesh.tet(e).begin(), mesh.tet(e).end()}));
  std::sort(tets.begin(), tets.end());
  return tets;
}

std::vector<Vec3> place_nodes(const TetMesh& mesh, const std::vector<std::int32_t>& nodes) {
  std::vector<Vec3> points;
  for (const auto i : nodes) points.push_back(rounded(mesh.nodes_m.at(i)));
  std::sort(points.begin(), points.end());
  return points;
}

double find_distance(const std::vector<Vec3>& a, const std::vector<Vec3>& b) {
  if (a.size() != b.size()) return HUGE_VAL;
  double greatest = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i)
    greatest = std::max(greatest, std::hypot(a[i][0] - b[i][0], a[i][1] - b[i][1], a[i][2] - b[i][2]));
  return greatest;
}

double calc_volume(const TetMesh& mesh) {
  double volume = 0.0;
  for (std::int64_t e = 0; e < mesh.tet_count(); ++e)
    for (const auto& face : kFaces) {
      const Vec3& a = mesh.nodes_m.at(mesh.tet(e)[face[0]]);
      const Vec3& b = mesh.nodes_m.at(mesh.tet(e)[face[1]]);
      const Vec3& c = mesh.nodes_m.at(mesh.tet(e)[face[2]]);
      volume += (a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) + a[2] * (b[0] * c[1] - b[1] * c[0])) / 6.0;
    }
  return volume;
}

void write_text(const std::filesystem::path& file, const std::string& text) { std::ofstream(file, std::ios::binary) << text; }

std::string read_text(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

}  // namespace carillon::mesh
