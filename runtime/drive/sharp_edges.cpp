#include "runtime/drive/sharp_edges.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "runtime/base/chance.hpp"

namespace carillon::drive {
namespace {

constexpr double kSharpCosine = 0.906;   // of 25 degrees
constexpr double kParallelCosine = 0.9;  // edges of one direction
constexpr double kNearRatio = 0.01;      // of the size
constexpr std::size_t kMaxCorners = 64;
constexpr double kFlatCosine = 0.9998;  // of 1 degree: facets of a flat surface

}  // namespace

std::size_t SharpEdges::Hash::operator()(const Cell& cell) const noexcept {
  std::uint64_t hash = 0;
  for (const std::int64_t k : cell) hash = base::scramble(hash + static_cast<std::uint64_t>(k) + base::kChanceStep);
  return static_cast<std::size_t>(hash);
}

SharpEdges::SharpEdges(std::span<const Vec3> vertices, std::span<const std::array<std::int32_t, 3>> triangles, double size_m)
    : near_m_(kNearRatio * size_m) {
  struct Seam {
    std::size_t facet = 0, next = 0;
    bool is_sharp = false;
  };
  std::vector<Vec3> normals;
  std::vector<char> curved(triangles.size(), 0);
  std::map<std::pair<std::int32_t, std::int32_t>, Seam> seams;
  for (std::size_t f = 0; f < triangles.size(); ++f) {
    const auto& corners = triangles[f];
    const Vec3& n =
        normals.emplace_back(calc_unit(cross(vertices[corners[1]] - vertices[corners[0]], vertices[corners[2]] - vertices[corners[0]])));
    for (int k = 0; k < 3; ++k) {
      const std::int32_t from = corners[k], to = corners[(k + 1) % 3];
      const auto [at, is_first] = seams.try_emplace(std::minmax(from, to), Seam{f, f});
      if (is_first) continue;
      Seam& seam = at->second;
      seam.next = f;
      const double cosine = dot(n, normals[seam.facet]);
      const bool is_convex = dot(cross(n, normals[seam.facet]), vertices[to] - vertices[from]) > 0.0;
      seam.is_sharp = is_convex && cosine < kSharpCosine;
      if (cosine > kSharpCosine && cosine < kFlatCosine) curved[seam.facet] = curved[f] = 1;
    }
  }
  for (const auto& [ends, seam] : seams) {
    if (!seam.is_sharp) continue;
    Edge edge{.begin = vertices[ends.first], .end = vertices[ends.second]};
    for (const std::size_t facet : {seam.facet, seam.next})
      if (curved[facet] != 0) edge.outward = normals[facet];
    add(edge);
  }
  find_corners();
}

/// Ends of edges of two directions.
void SharpEdges::find_corners() {
  std::map<Vec3, Vec3> directions;  // of an edge at each end
  for (const Edge& edge : edges_) {
    if (edge.outward != Vec3{}) continue;
    const Vec3 direction = calc_unit(edge.end - edge.begin);
    for (const Vec3& end : {edge.begin, edge.end}) {
      const auto [at, is_first] = directions.try_emplace(end, direction);
      const bool turns = !is_first && std::abs(dot(at->second, direction)) < kParallelCosine;
      if (turns && std::find(corners_.begin(), corners_.end(), end) == corners_.end()) corners_.push_back(end);
      if (corners_.size() <= kMaxCorners) continue;
      corners_.clear();
      return;
    }
  }
}

SharpEdges::Cell SharpEdges::find_cell(const Vec3& x) const {
  Cell cell{};
  for (std::size_t k = 0; k < 3; ++k) cell[k] = static_cast<std::int64_t>(std::floor(std::clamp(x[k] / (2.0 * near_m_), -1e15, 1e15)));
  return cell;
}

void SharpEdges::add(const Edge& edge) {
  const int index = static_cast<int>(edges_.size());
  edges_.push_back(edge);
  const int parts = std::max(1, static_cast<int>(std::ceil(norm(edge.end - edge.begin) / near_m_)));
  for (int part = 0; part <= parts; ++part) {
    const Cell middle = find_cell(edge.begin + (static_cast<double>(part) / parts) * (edge.end - edge.begin));
    for (int k = 0; k < 27; ++k) {
      std::vector<int>& cell = cells_[{middle[0] + k % 3 - 1, middle[1] + k / 3 % 3 - 1, middle[2] + k / 9 - 1}];
      if (cell.empty() || cell.back() != index) cell.push_back(index);
    }
  }
}

NearEdges SharpEdges::find_near(const Vec3& point) const {
  NearEdges near;
  const auto found = cells_.find(find_cell(point));
  if (found == cells_.end()) return near;
  Vec3 first{};
  double nearest = near_m_;
  for (const int index : found->second) {
    const Edge& edge = edges_[index];
    const Vec3 along = edge.end - edge.begin;
    const double share = std::clamp(dot(point - edge.begin, along) / dot(along, along), 0.0, 1.0);
    const Vec3 foot = edge.begin + share * along;
    const double distance = norm(foot - point);
    if (distance > near_m_) continue;
    if (edge.outward != Vec3{}) {
      if (distance > nearest) continue;
      nearest = distance;
      near.rim_m = foot;
      near.outward = edge.outward;
      continue;
    }
    const Vec3 direction = calc_unit(along);
    if (near.directions == 0) {
      first = direction;
      near.directions = 1;
    } else if (std::abs(dot(first, direction)) < kParallelCosine) {
      near.directions = 2;
    }
  }
  return near;
}

}  // namespace carillon::drive
