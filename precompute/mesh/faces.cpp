// Method: faces are bucketed by smallest corner and sorted within a bucket; unmatched faces are on the boundary.

#include "precompute/mesh/faces.hpp"

#include <algorithm>

#include "precompute/mesh/check.hpp"

namespace carillon::mesh {

std::vector<Face> sort_faces(const TetMesh& mesh, const std::vector<std::int32_t>& node_of) {
  const auto make_face = [&](std::int64_t e, int local) {
    const auto tet = mesh.tet(e);
    std::array<std::int32_t, 3> v{};
    for (std::size_t k = 0; k < 3; ++k) {
      const auto node = tet[kFaces[local][k]];
      v[k] = node_of.empty() ? node : node_of[node];
    }
    bool odd = false;
    const auto order = [&](std::size_t i, std::size_t j) {
      if (v[j] < v[i]) {
        std::swap(v[i], v[j]);
        odd = !odd;
      }
    };
    order(0, 1);
    order(1, 2);
    order(0, 1);
    return Face{v[0], v[1], v[2], static_cast<std::int32_t>(e), static_cast<std::int8_t>(local), odd};
  };
  std::vector<std::size_t> begin(mesh.nodes_m.size() + 1, 0);
  std::vector<Face> unsorted;
  unsorted.reserve(4 * mesh.tet_count());
  for (std::int64_t e = 0; e < mesh.tet_count(); ++e)
    for (int local = 0; local < 4; ++local) {
      unsorted.push_back(make_face(e, local));
      ++begin[unsorted.back().a + 1];
    }
  for (std::size_t i = 1; i < begin.size(); ++i) begin[i] += begin[i - 1];
  std::vector<Face> faces(unsorted.size());
  std::vector<std::size_t> next(begin.begin(), begin.end() - 1);
  for (const Face& face : unsorted) faces[next[face.a]++] = face;
  // Faces come in element order, so a stable sort by the other two corners suffices; about twenty faces share a lowest corner.
  const auto get_key = [](const Face& face) { return std::int64_t{face.b} << 32 | face.c; };
  constexpr std::size_t kFew = 64;
  for (std::size_t n = 0; n + 1 < begin.size(); ++n) {
    const auto first = faces.begin() + static_cast<std::ptrdiff_t>(begin[n]),
               last = faces.begin() + static_cast<std::ptrdiff_t>(begin[n + 1]);
    if (begin[n + 1] - begin[n] > kFew) {
      std::stable_sort(first, last, [&](const Face& x, const Face& y) { return get_key(x) < get_key(y); });
      continue;
    }
    for (auto next = first; next < last; ++next) {
      const Face face = *next;
      auto to = next;
      for (; to != first && get_key(face) < get_key(to[-1]); --to) *to = to[-1];
      *to = face;
    }
  }
  return faces;
}

int find_edge(int i, int j) {
  for (std::size_t e = 0; e < kEdges.size(); ++e)
    if ((kEdges[e][0] == i && kEdges[e][1] == j) || (kEdges[e][0] == j && kEdges[e][1] == i)) return static_cast<int>(e);
  return -1;
}

Surface extract_boundary(const TetMesh& mesh) {
  const auto faces = sort_faces(mesh);
  std::vector<std::pair<std::int32_t, int>> boundary;  // element, local face
  for (std::size_t i = 0; i < faces.size();) {
    std::size_t end = i + 1;
    while (end < faces.size() && same_corners(faces[i], faces[end])) ++end;
    if (end - i == 1) boundary.emplace_back(faces[i].tet, faces[i].local);
    i = end;
  }
  std::sort(boundary.begin(), boundary.end());
  Surface surface;
  const auto add = [&](std::int32_t e, int i, int j, int k) {
    const auto tet = mesh.tet(e);
    surface.triangles.push_back({tet[i], tet[j], tet[k]});
    surface.tets.push_back(e);
  };
  for (const auto& [e, local] : boundary) {
    const auto [i, j, k] = kFaces[local];
    if (mesh.order == 1) {
      add(e, i, j, k);
      continue;
    }
    const int ij = 4 + find_edge(i, j), jk = 4 + find_edge(j, k), ki = 4 + find_edge(k, i);
    add(e, i, ij, ki);
    add(e, ij, j, jk);
    add(e, ki, jk, k);
    add(e, ij, jk, ki);
  }
  std::vector<std::int32_t> vertex(mesh.nodes_m.size(), -1);
  for (const auto& triangle : surface.triangles)
    for (const auto node : triangle) vertex[node] = 0;
  for (std::size_t i = 0; i < vertex.size(); ++i)
    if (vertex[i] == 0) {
      vertex[i] = static_cast<std::int32_t>(surface.nodes.size());
      surface.nodes.push_back(static_cast<std::int32_t>(i));
    }
  for (auto& triangle : surface.triangles)
    for (auto& node : triangle) node = vertex[node];
  return surface;
}

}  // namespace carillon::mesh
