// Mesh measures independent of the mesher's code: volume by the divergence theorem, conformity, dihedral angles, Jacobians.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <set>

#include "precompute/mesh/tet_mesh.hpp"

namespace carillon::shapes::tests {

struct Quality {
  double volume_m3 = 0.0;            // of the mapped elements (quadratic: by quadrature)
  double min_corner_volume = 1e300;  // of the straight tetrahedra of the corners [m3]
  double min_dihedral_deg = 180.0, max_dihedral_deg = 0.0;
  double min_jacobian_ratio = 1e300;  // least over largest Jacobian determinant within an element, worst element
  long long boundary_faces = 0;
  bool conforming = true;  // no face has more than two elements, and the boundary is closed
  long long unused_nodes = 0;
  long long repeated_nodes = 0;
};

// The Jacobian determinant of a quadratic tetrahedron at the reference point (r, s, t).
inline double calc_jacobian(const std::array<Vec3, 10>& x, double r, double s, double t) {
  const double q = 1.0 - r - s - t;
  const std::array<double, 4> l{q, r, s, t};
  const std::array<Vec3, 4> dl{{{-1, -1, -1}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
  std::array<Vec3, 3> columns{};  // d x / d (r, s, t)
  for (int n = 0; n < 10; ++n) {
    for (int d = 0; d < 3; ++d) {
      double slope = 0.0;
      if (n < 4) {
        slope = (4.0 * l[n] - 1.0) * dl[n][d];
      } else {
        const auto [a, b] = mesh::kEdges[n - 4];
        slope = 4.0 * (l[a] * dl[b][d] + l[b] * dl[a][d]);
      }
      for (int c = 0; c < 3; ++c) columns[d][c] += slope * x[n][c];
    }
  }
  return dot(columns[0], cross(columns[1], columns[2]));
}

inline Quality measure(const mesh::TetMesh& mesh) {
  Quality quality;
  std::map<std::array<int, 3>, int> faces;
  std::vector<bool> used(mesh.nodes_m.size(), false);
  for (std::int64_t e = 0; e < mesh.tet_count(); ++e) {
    const auto tet = mesh.tet(e);
    for (auto node : tet) used[node] = true;
    std::array<Vec3, 4> x;
    for (int i = 0; i < 4; ++i) x[i] = mesh.nodes_m[tet[i]];
    const double volume = calc_det(x[1] - x[0], x[2] - x[0], x[3] - x[0]) / 6.0;
    quality.min_corner_volume = std::min(quality.min_corner_volume, volume);
    std::array<Vec3, 4> normals;
    for (int f = 0; f < 4; ++f) {
      const auto& face = mesh::kFaces[f];
      std::array<int, 3> key{tet[face[0]], tet[face[1]], tet[face[2]]};
      std::sort(key.begin(), key.end());
      ++faces[key];
      normals[f] = cross(x[face[1]] - x[face[0]], x[face[2]] - x[face[0]]);
    }
    for (int f = 0; f < 4; ++f) {
      for (int g = f + 1; g < 4; ++g) {
        const double cosine = -dot(normals[f], normals[g]) / (norm(normals[f]) * norm(normals[g]));
        const double angle = std::acos(std::clamp(cosine, -1.0, 1.0)) * 180.0 / std::numbers::pi;
        quality.min_dihedral_deg = std::min(quality.min_dihedral_deg, angle);
        quality.max_dihedral_deg = std::max(quality.max_dihedral_deg, angle);
      }
    }
    if (mesh.order == 1) {
      quality.volume_m3 += volume;
      quality.min_jacobian_ratio = 1.0;
    } else {
      std::array<Vec3, 10> nodes;
      for (int i = 0; i < 10; ++i) nodes[i] = mesh.nodes_m[tet[i]];
      double min = 1e300, max = -1e300;
      // The determinant is a cubic: the degree-3 rule with five points integrates it exactly.
      const std::array<std::array<double, 4>, 5> rule{{{0.25, 0.25, 0.25, -2.0 / 15.0},
                                                       {1.0 / 6, 1.0 / 6, 1.0 / 6, 0.075},
                                                       {0.5, 1.0 / 6, 1.0 / 6, 0.075},
                                                       {1.0 / 6, 0.5, 1.0 / 6, 0.075},
                                                       {1.0 / 6, 1.0 / 6, 0.5, 0.075}}};
      for (const auto& point : rule) {
        const double jacobian = calc_jacobian(nodes, point[0], point[1], point[2]);
        quality.volume_m3 += point[3] * jacobian;
      }
      // All ten nodes, quarter points among them: stricter than any quadrature rule.
      for (int i = 0; i <= 4; ++i) {
        for (int j = 0; i + j <= 4; ++j) {
          for (int k = 0; i + j + k <= 4; ++k) {
            const double jacobian = calc_jacobian(nodes, i / 4.0, j / 4.0, k / 4.0);
            min = std::min(min, jacobian);
            max = std::max(max, jacobian);
          }
        }
      }
      quality.min_jacobian_ratio = std::min(quality.min_jacobian_ratio, min / max);
    }
  }
  std::map<std::array<int, 2>, int> edges;
  for (const auto& [face, count] : faces) {
    if (count > 2) quality.conforming = false;
    if (count != 1) continue;
    ++quality.boundary_faces;
    ++edges[{face[0], face[1]}];
    ++edges[{face[1], face[2]}];
    ++edges[{face[0], face[2]}];
  }
  for (const auto& [edge, count] : edges) quality.conforming = quality.conforming && count == 2;
  for (bool is_used : used) quality.unused_nodes += is_used ? 0 : 1;
  std::set<Vec3> places(mesh.nodes_m.begin(), mesh.nodes_m.end());
  quality.repeated_nodes = static_cast<long long>(mesh.nodes_m.size() - places.size());
  return quality;
}

}  // namespace carillon::shapes::tests
