// Method: volume by tetrahedra against the divergence theorem or the distance field; boundary node distances by exact nearest points;
//   shells of the mesh by walking its boundary. Shells of a clean solid: parts of its surface; otherwise regions of the body and of the
//   surrounding space in the distance field, found by sample rows, minus one (in space, each closed surface separates one region into two:
//   Alexander duality).
#include "precompute/mesher/verify.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

#include "precompute/mesh/check.hpp"
#include "precompute/mesh/parts.hpp"
#include "precompute/mesher/tet_quality.hpp"

namespace carillon::mesher {
namespace {

// Parts thinner than the first, or shorter than the second, in edges, may be lost at that element size.
// Limits for stuffing: cells through the least thickness, and relative length error. Below, tips end short (the ears of the solid bunny by
// 1.2 mm of 130 with 20,000 nodes).
constexpr double kMinCellsPerThickness = 3, kMaxStuffingLengthError = 0.002;
constexpr double kMaxHalfAngleCosine = 0.64;  // cosine of half the angle between two directions to the surface
constexpr double kMinThickness = 1.0, kMinLength = 3;
// Length deficit allowed for coarse elements: relative to the extent, and in edges.
constexpr double kMaxLostDistance = 0.1, kMaxLostDistanceEdges = 2;
constexpr double kMaxRestorableEdgePerWall = 3;  // edge length over wall thickness above which shorter edges cannot restore a lost hollow

/// Region of the field, inside or outside the body.
struct Region {
  double samples = 0, faces = 0;  // faces: of samples against the other kind
  std::array<std::int32_t, 3> low{INT32_MAX, INT32_MAX, INT32_MAX}, high{INT32_MIN, INT32_MIN, INT32_MIN};
};

/// Run of samples of one kind along x.
struct Run {
  std::int32_t first = 0, last = 0;
  bool inside = false;
};

/// Regions of the field connected by sample faces; with `by_corners` also by edges and corners.
std::vector<Region> find_regions(const DistanceField& field, double wall_m, bool by_corners) {
  const auto rows = static_cast<std::size_t>(field.size[1]) * static_cast<std::size_t>(field.size[2]);
  std::vector<std::size_t> start(rows + 1, 0);
  std::vector<Run> runs;
  for (std::size_t row = 0; row < rows; ++row) {
    start[row] = runs.size();
    const float* s = field.samples.data() + row * static_cast<std::size_t>(field.size[0]);
    for (std::int32_t i = 0; i < field.size[0]; ++i) {
      const bool inside = s[i] < 0 && (wall_m <= 0 || s[i] > -wall_m);
      if (i == 0 || runs.back().inside != inside) runs.push_back({i, i, inside});
      runs.back().last = i;
    }
  }
  start[rows] = runs.size();
  mesh::Parts parts(runs.size());
  std::vector<double> faces(runs.size(), 0);
  const std::int32_t reach = by_corners ? 1 : 0;
  const auto join = [&](std::size_t a, std::size_t b) { parts.join(static_cast<std::int32_t>(a), static_cast<std::int32_t>(b)); };
  // Runs of two adjacent rows (or, if `across`, diagonally adjacent).
  const auto join_rows = [&](std::size_t one, std::size_t other, bool across) {
    std::size_t a = start[one], b = start[other];
    while (a < start[one + 1] && b < start[other + 1]) {
      const std::int32_t first = std::max(runs[a].first, runs[b].first), last = std::min(runs[a].last, runs[b].last);
      if (first <= last && runs[a].inside != runs[b].inside && !across) {
        faces[a] += last - first + 1;
        faces[b] += last - first + 1;
      } else if (first <= last && runs[a].inside == runs[b].inside) {
        join(a, b);
      }
      // The next run of either row may touch this one of the other at a corner.
      if (reach > 0 && b + 1 < start[other + 1] && runs[b].last == last && runs[b + 1].inside == runs[a].inside) join(a, b + 1);
      if (reach > 0 && a + 1 < start[one + 1] && runs[a].last == last && runs[a + 1].inside == runs[b].inside) join(a + 1, b);
      runs[a].last < runs[b].last ? ++a : ++b;
    }
  };
  for (std::size_t row = 0; row < rows; ++row) {
    const std::size_t ny = field.size[1];
    if (row % ny + 1 < ny) join_rows(row, row + 1, false);
    if (row + ny < rows) join_rows(row, row + ny, false);
    if (by_corners && row % ny + 1 < ny && row + ny + 1 < rows) join_rows(row, row + ny + 1, true);
    if (by_corners && row % ny > 0 && row + ny < rows) join_rows(row, row + ny - 1, true);
    for (std::size_t r = start[row]; r + 1 < start[row + 1]; ++r) ++faces[r], ++faces[r + 1];
  }
  std::vector<std::int32_t> number(runs.size(), -1);
  std::vector<Region> regions;
  for (std::size_t row = 0; row < rows; ++row)
    for (std::size_t r = start[row]; r < start[row + 1]; ++r) {
      std::int32_t& n = number[parts.find(static_cast<std::int32_t>(r))];
      if (n < 0) {
        n = static_cast<std::int32_t>(regions.size());
        regions.emplace_back();
      }
      Region& region = regions[n];
      region.samples += runs[r].last - runs[r].first + 1;
      region.faces += faces[r];
      const std::array<std::int32_t, 3> low{runs[r].first, static_cast<std::int32_t>(row) % field.size[1],
                                            static_cast<std::int32_t>(row) / field.size[1]};
      for (int c = 0; c < 3; ++c) {
        region.low[c] = std::min(region.low[c], low[c]);
        region.high[c] = std::max(region.high[c], c == 0 ? runs[r].last : low[c]);
      }
    }
  return regions;
}

/// Boundary faces grouped by common edges.
std::int64_t count_parts(const std::vector<Triangle>& boundary, std::size_t nodes) {
  TriangleSurface skin;
  skin.points.resize(nodes);
  skin.triangles = boundary;
  return static_cast<std::int64_t>(split_parts(skin).size());
}

/// Extent deficit of the mesh beyond that of coarse elements; empty if none. `is` begins the sentence.
std::string describe_lost(const Body& body, const Vec3& made, double edge_m, const char* is) {
  const Vec3 wanted = calc_used_box(body.repaired.surface).extent();
  std::string text;
  for (int c = 0; c < 3; ++c) {
    const double extent = wanted[c] - 2 * body.repaired.offset_m, lost = extent - made[c];
    if (lost > kMaxLostDistance * extent && lost > kMaxLostDistanceEdges * edge_m)
      text = fmt::format("{} {:.3g} m long along {} where the body is {:.3g} m: parts thinner than its elements are missing", is, made[c],
                         "xyz"[c], extent);
  }
  return text;
}

}  // namespace

std::string find_lost(const Body& body, double edge_m) {
  if (!body.field) return "";
  const std::vector<Region> regions = find_regions(*body.field, 0, true);
  Vec3 made{};
  for (int c = 0; c < 3; ++c) {
    std::int32_t low = INT32_MAX, high = INT32_MIN;
    for (std::size_t r = 1; r < regions.size(); ++r) {  // the first is the surrounding space
      low = std::min(low, regions[r].low[c]);
      high = std::max(high, regions[r].high[c]);
    }
    // The skin is less than a sample beyond the last inner one.
    if (regions.size() > 1) made[c] = body.field->voxel_m * (high - low + 2);
  }
  return describe_lost(body, made, edge_m, "would be at most");
}

double calc_least_thickness(const DistanceField& field) {
  double least = field.inside_m;
  const double shallow = 1.5 * field.voxel_m, deep = field.inside_m - field.voxel_m;
  for (std::int32_t k = 1; k + 1 < field.size[2]; ++k)
    for (std::int32_t j = 1; j + 1 < field.size[1]; ++j)
      for (std::int32_t i = 1; i + 1 < field.size[0]; ++i) {
        const double depth = -field.sample(i, j, k);
        if (depth < shallow || depth > deep || depth >= least) continue;
        const Vec3 slope{field.sample(i + 1, j, k) - field.sample(i - 1, j, k), field.sample(i, j + 1, k) - field.sample(i, j - 1, k),
                         field.sample(i, j, k + 1) - field.sample(i, j, k - 1)};
        if (norm(slope) < 2 * field.voxel_m * kMaxHalfAngleCosine) least = depth;
      }
  return 2 * least;
}

std::string find_cut(const mesh::TetMesh& linear, const Body& body, double edge_m) {
  const double thickness = body.wall_m > 0 ? body.wall_m : calc_least_thickness(*body.field);
  if (thickness < kMinCellsPerThickness * edge_m)
    return fmt::format("has edges of {:.3g} m where the body is {:.3g} m thick at its thinnest, {:.1f} of them", edge_m, thickness,
                       thickness / edge_m);
  const Vec3 made = calc_box(linear.nodes_m).extent(), wanted = calc_used_box(body.repaired.surface).extent();
  for (int c = 0; c < 3; ++c) {
    const double extent = wanted[c] - 2 * body.repaired.offset_m;
    if (std::abs(made[c] / extent - 1) > kMaxStuffingLengthError)
      return fmt::format("is {:.4g} m long along {} where the body is {:.4g} m", made[c], "xyz"[c], extent);
  }
  return "";
}

Shells count_shells(const Body& body, double edge_m) {
  Shells shells;
  if (!body.field) {
    for (const TriangleSurface& part : split_parts(body.repaired.surface)) {
      const double thickness = 2 * std::abs(calc_volume(part)) / calc_area(part);
      ++shells.max;
      shells.min += thickness >= kMinThickness * edge_m && calc_box(part.points).diagonal() >= kMinLength * edge_m;
    }
  } else {
    const double voxel = body.field->voxel_m;
    // Touching parts may be meshed joined or apart.
    shells.max = static_cast<std::int64_t>(find_regions(*body.field, body.wall_m, false).size());
    const auto regions = find_regions(*body.field, body.wall_m, true);
    for (const Region& region : regions) {
      // A surface of sample faces has about 1.5 times the area of the smooth one.
      const double thickness = 2 * region.samples * voxel / std::max(region.faces / 1.5, 1.0);
      double diagonal = 0;
      for (int c = 0; c < 3; ++c) diagonal = std::hypot(diagonal, voxel * (region.high[c] - region.low[c] + 1));
      const bool is_space = &region == regions.data();  // the field begins outside the body
      shells.min += is_space || (thickness >= std::min(kMinThickness * edge_m, body.wall_m > 0 ? 0.6 * body.wall_m : edge_m) &&
                                 diagonal >= kMinLength * edge_m);
    }
    --shells.max;
    --shells.min;
    // A requested wall implies a hollow, however small.
    if (body.wall_m > 0 && shells.max >= 2) shells.min = std::max<std::int64_t>(shells.min, 2);
  }
  shells.min = std::max<std::int64_t>(shells.min, 1);
  shells.max = std::max(shells.max, shells.min);
  return shells;
}

Comparison compare(const mesh::TetMesh& linear, const Body& body, const Expectation& expectation) {
  Comparison result;
  const double edge = expectation.edge_m;
  result.volume_m3 = measure(linear).volume_m3;
  const auto boundary = find_boundary(linear);
  result.shells = count_parts(boundary, linear.nodes_m.size());
  std::vector<char> seen(linear.nodes_m.size(), 0);
  std::int64_t outside = 0;
  const double max_outside = 0.1 * edge + (body.field ? 0.5 * body.field->voxel_m : 0);
  for (const Triangle& t : boundary)
    for (const std::int32_t v : t) {
      if (seen[v]++) continue;
      const double way = calc_outside(body, linear.nodes_m[v]);
      result.farthest_outside_m = std::max(result.farthest_outside_m, way);
      outside += way > max_outside;
    }

  const double part =
      0.1 * edge * (body.wall_m > 0 ? calc_area(body.repaired.surface) / 3 : calc_area(body.repaired.surface)) / expectation.volume_m3;
  const double max_off = (body.wall_m > 0 ? 0.08 : 0.03) + part;
  const double off = result.volume_m3 / expectation.volume_m3 - 1;
  const std::int64_t flat = mesh::count_flat(linear);
  if (flat > 0)
    result.fault = fmt::format("has {} element{} without volume", flat, flat == 1 ? "" : "s");
  else if (!(std::abs(off) <= max_off))
    result.fault = fmt::format("has {:+.1f} % of the body's volume too {}, where {:.1f} % are the most that its facets explain",
                               100 * std::abs(off), off > 0 ? "much" : "little", 100 * max_off);
  else if (outside > 0)
    result.fault = fmt::format("has {} node{} outside the body, by up to {:.3g} mm", outside, outside == 1 ? "" : "s",
                               1000 * result.farthest_outside_m);
  else if (result.shells < expectation.shells.min || result.shells > expectation.shells.max)
    result.fault = fmt::format("has {} closed surface{} where the body has {}", result.shells, result.shells == 1 ? "" : "s",
                               expectation.shells.min == expectation.shells.max
                                   ? fmt::format("{}", expectation.shells.max)
                                   : fmt::format("{} to {}", expectation.shells.min, expectation.shells.max));

  // A hollow was filled where the elements are several times longer than the wall is thick.
  result.is_hopeless = flat > 0 || (!result.fault.empty() && result.shells < expectation.shells.min && body.wall_m > 0 &&
                                    edge > kMaxRestorableEdgePerWall * body.wall_m);
  if (std::string lost = describe_lost(body, calc_box(linear.nodes_m).extent(), edge, "is"); !lost.empty()) {
    result.is_hopeless = true;
    result.fault = std::move(lost);
  }
  return result;
}

}  // namespace carillon::mesher
