#include "precompute/simulation/transient/sheet_mesh.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "runtime/base/error.hpp"

namespace carillon::transient {
namespace {

constexpr double kMaxBowRatio = 0.4;

void check_cells(int cells) {
  if (cells < 2) throw InputError(fmt::format("a sheet has {} cells; give two or more", cells));
}

/// Ends, centre and radius of an arc with this chord and rise: a point at share s of its length.
Vec3 find_on_arc(double chord_m, double bow_m, double s) {
  if (bow_m == 0.0) return {chord_m * (s - 0.5), 0.0, 0.0};
  const double radius = (0.25 * chord_m * chord_m + bow_m * bow_m) / (2.0 * bow_m);
  const double half = std::atan2(0.5 * chord_m, radius - bow_m), angle = (2.0 * s - 1.0) * half;
  return {radius * std::sin(angle), 0.0, radius * std::cos(angle) - (radius - bow_m)};
}

}  // namespace

SheetMesh make_rectangle(double length_m, double width_m, int cells, double bow_m) {
  check_cells(cells);
  if (!(length_m > 0.0 && width_m > 0.0)) throw InputError("the sides of a sheet must be positive");
  if (!(bow_m >= 0.0 && bow_m <= kMaxBowRatio * length_m))
    throw InputError(fmt::format("the bow of a sheet must be from 0 to {:g} of its length", kMaxBowRatio));
  const double cell = std::max(length_m, width_m) / cells;
  const int nx = std::max(1, static_cast<int>(std::lround(length_m / cell))),
            ny = std::max(1, static_cast<int>(std::lround(width_m / cell)));
  SheetMesh mesh;
  const auto number = [&](int i, int j) { return static_cast<std::int32_t>(i * (ny + 1) + j); };
  for (int i = 0; i <= nx; ++i) {
    for (int j = 0; j <= ny; ++j) {
      Vec3 x = find_on_arc(length_m, bow_m, static_cast<double>(i) / nx);
      x[1] = width_m * (static_cast<double>(j) / ny - 0.5);
      mesh.vertices_m.push_back(x);
      if (i == 0) mesh.node_sets["x-min"].push_back(number(i, j));
      if (i == nx) mesh.node_sets["x-max"].push_back(number(i, j));
      if (j == 0) mesh.node_sets["y-min"].push_back(number(i, j));
      if (j == ny) mesh.node_sets["y-max"].push_back(number(i, j));
      if (i == 0 || i == nx || j == 0 || j == ny) mesh.node_sets["rim"].push_back(number(i, j));
    }
  }
  for (int i = 0; i < nx; ++i) {
    for (int j = 0; j < ny; ++j) {
      const std::int32_t a = number(i, j), b = number(i + 1, j), c = number(i + 1, j + 1), d = number(i, j + 1);
      if ((i + j) % 2 == 0) {
        mesh.triangles.push_back({a, b, c});
        mesh.triangles.push_back({a, c, d});
      } else {
        mesh.triangles.push_back({a, b, d});
        mesh.triangles.push_back({b, c, d});
      }
    }
  }
  return mesh;
}

SheetMesh make_disc(double radius_m, int cells) {
  check_cells(cells);
  if (!(radius_m > 0.0)) throw InputError("the radius of a sheet must be positive");
  const int rings = (cells + 1) / 2;
  SheetMesh mesh;
  mesh.vertices_m.push_back({});
  mesh.node_sets["centre"] = {0};
  for (int r = 1; r <= rings; ++r) {
    for (int k = 0; k < 6 * r; ++k) {
      const double angle = 2.0 * std::numbers::pi * k / (6.0 * r), at = radius_m * r / rings;
      if (r == rings) mesh.node_sets["rim"].push_back(static_cast<std::int32_t>(mesh.vertices_m.size()));
      mesh.vertices_m.push_back({at * std::cos(angle), at * std::sin(angle), 0.0});
    }
  }
  // Ring r begins at 1 + 3 r (r - 1).
  const auto number = [](int r, int k) { return static_cast<std::int32_t>(r == 0 ? 0 : 1 + 3 * r * (r - 1) + k % (6 * r)); };
  for (int r = 1; r <= rings; ++r) {
    for (int sector = 0; sector < 6; ++sector) {
      for (int k = 0; k < r; ++k) {
        const int outer = sector * r + k, inner = sector * (r - 1) + k;
        mesh.triangles.push_back({number(r, outer), number(r, outer + 1), number(r - 1, inner)});
        if (k + 1 < r) mesh.triangles.push_back({number(r - 1, inner), number(r, outer + 1), number(r - 1, inner + 1)});
      }
    }
  }
  return mesh;
}

SheetElements make_elements(const SheetMesh& mesh, const std::vector<bool>& clamped) {
  SheetElements made;
  made.vertices = static_cast<std::int32_t>(mesh.vertices_m.size());
  made.rest_m = mesh.vertices_m;
  struct Side {
    std::int32_t edge, triangle, corner;  // corner: opposite to the edge
    bool is_left;
  };
  std::map<std::array<std::int32_t, 2>, std::vector<Side>> sides;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const Triangle& v = mesh.triangles[t];
    const Vec3 twice = cross(mesh.vertices_m[v[1]] - mesh.vertices_m[v[0]], mesh.vertices_m[v[2]] - mesh.vertices_m[v[0]]);
    if (!(norm(twice) > 0.0)) throw InputError(fmt::format("triangle {} of the sheet has no area; remove it", t));
    for (std::size_t i = 0; i < 3; ++i) {
      const std::int32_t a = v[(i + 1) % 3], b = v[(i + 2) % 3];
      sides[{std::min(a, b), std::max(a, b)}].push_back({0, static_cast<std::int32_t>(t), static_cast<std::int32_t>(i), a < b});
    }
  }
  made.nodes.resize(mesh.triangles.size());
  made.turn.resize(mesh.triangles.size());
  made.side.resize(mesh.triangles.size());
  made.edges = static_cast<std::int32_t>(sides.size());
  std::vector<Vec3> ghosts_m;
  std::int32_t e = 0;
  for (auto& [ends, at] : sides) {
    const Vec3 &a = mesh.vertices_m[ends[0]], &b = mesh.vertices_m[ends[1]];
    if (at.size() > 2)
      throw InputError(fmt::format("the edge between vertices {} and {} of the sheet has {} triangles; a sheet has one or two there",
                                   ends[0], ends[1], at.size()));
    if (at.size() == 2 && at[0].is_left == at[1].is_left)
      throw InputError(fmt::format("triangles {} and {} of the sheet turn against each other; let all of them turn the same way",
                                   at[0].triangle, at[1].triangle));
    made.edge.push_back(ends);
    made.rest_m.push_back(0.5 * (a + b));
    const bool constraints = at.size() == 1 && clamped[ends[0]] && clamped[ends[1]];
    for (std::size_t k = 0; k < at.size(); ++k) {
      const std::size_t t = at[k].triangle, i = at[k].corner;
      const Triangle& v = mesh.triangles[t];
      for (std::size_t c = 0; c < 3; ++c) made.nodes[t][c] = v[c];
      made.nodes[t][6 + i] = made.vertices + e;
      made.side[t][i] = at.size() == 2 && !at[k].is_left ? -1.0 : 1.0;
      if (at.size() == 2) {
        const std::size_t other = at[1 - k].triangle;
        made.nodes[t][3 + i] = mesh.triangles[other][at[1 - k].corner];
        made.turn[t][i] = 0.5;
      } else if (constraints) {
        // The mirror image of the corner about the edge, in the plane of the triangle.
        const Vec3& c = mesh.vertices_m[v[i]];
        const Vec3 along = normalise(b - a), foot = a + dot(c - a, along) * along;
        made.nodes[t][3 + i] = made.vertices + made.edges + static_cast<std::int32_t>(ghosts_m.size());
        ghosts_m.push_back(foot + (foot - c));
        made.turn[t][i] = 1.0;
      } else {
        made.nodes[t][3 + i] = -1;
        made.turn[t][i] = 0.0;
      }
    }
    ++e;
  }
  made.ghosts = static_cast<std::int32_t>(ghosts_m.size());
  made.rest_m.insert(made.rest_m.end(), ghosts_m.begin(), ghosts_m.end());
  return made;
}

}  // namespace carillon::transient
