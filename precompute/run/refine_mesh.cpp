// Method: regular refinement: every edge is halved; the inner octahedron is cut along its shortest diagonal.
// Source: Bey, Tetrahedral grid refinement, Computing 55, 1995, section 2.
// Deviations: the shortest diagonal instead of a fixed one preserves element quality and does not affect neighbours.
#include <algorithm>
#include <array>
#include <cstdint>
#include <unordered_map>
#include <utility>

#include "precompute/mesh/check.hpp"
#include "precompute/run/stages.hpp"

namespace carillon::run {
namespace {

using Barycentric = std::array<double, 4>;

/// The four corner tetrahedra, in nodes of the old element.
constexpr std::array<std::array<int, 4>, 4> kCornerTets{{{0, 4, 6, 7}, {4, 1, 5, 8}, {6, 5, 2, 9}, {7, 8, 9, 3}}};
/// A diagonal of the octahedron and the ring of the other four nodes.
struct Diagonal {
  int from, to;
  std::array<int, 4> ring;
};
constexpr std::array<Diagonal, 3> kDiagonals{{{4, 9, {5, 6, 7, 8}}, {5, 7, {4, 6, 9, 8}}, {6, 8, {4, 5, 9, 7}}}};
/// Nodes of each edge and face of the old element, as bit sets.
constexpr std::array<std::uint32_t, 6> kEdgeBits{0x013, 0x026, 0x045, 0x089, 0x10A, 0x20C};
constexpr std::array<std::uint32_t, 4> kFaceBits{0x32E, 0x2CD, 0x19B, 0x077};

Barycentric find_barycentric(int node) {
  Barycentric at{};
  if (node < 4) {
    at[node] = 1.0;
  } else {
    for (const int corner : mesh::kEdges[node - 4]) at[corner] = 0.5;
  }
  return at;
}

double calc_determinant(const std::array<int, 4>& nodes) {
  std::array<Vec3, 3> u;
  const Barycentric base = find_barycentric(nodes[0]);
  for (int i = 0; i < 3; ++i) {
    const Barycentric at = find_barycentric(nodes[i + 1]);
    for (int k = 0; k < 3; ++k) u[i][k] = at[k + 1] - base[k + 1];  // x, y, z of the reference element are its coordinates 1, 2, 3
  }
  return calc_det(u[0], u[1], u[2]);
}

/// Quadratic map of the element.
Vec3 map_point(std::span<const Vec3, 10> x, const Barycentric& l) {
  std::array<double, 10> shape{};
  for (int i = 0; i < 4; ++i) shape[i] = l[i] * (2 * l[i] - 1);
  for (int e = 0; e < 6; ++e) shape[4 + e] = 4 * l[mesh::kEdges[e][0]] * l[mesh::kEdges[e][1]];
  Vec3 point{};
  for (int i = 0; i < 10; ++i)
    for (int k = 0; k < 3; ++k) point[k] += shape[i] * x[i][k];
  return point;
}

/// The eight children of an element in its own nodes, positively oriented.
std::array<std::array<int, 4>, 8> find_children(std::span<const Vec3, 10> x) {
  const auto calc_square = [&](const Diagonal& diagonal) {
    const Vec3 way = x[diagonal.from] - x[diagonal.to];
    return dot(way, way);
  };
  const Diagonal* shortest = &kDiagonals[0];
  for (const Diagonal& diagonal : kDiagonals) {
    if (calc_square(diagonal) < calc_square(*shortest) * (1 - 1e-9)) shortest = &diagonal;
  }
  std::array<std::array<int, 4>, 8> children{};
  std::copy(kCornerTets.begin(), kCornerTets.end(), children.begin());
  for (int i = 0; i < 4; ++i) {
    auto& child = children[4 + i];
    child = {shortest->from, shortest->to, shortest->ring[i], shortest->ring[(i + 1) % 4]};
    if (calc_determinant(child) < 0) std::swap(child[2], child[3]);
  }
  return children;
}

/// Mid-nodes of the children's edges, one per pair of old nodes.
class MiddleNodes {
 public:
  explicit MiddleNodes(mesh::TetMesh& fine) : fine_(fine) {
    for (auto& [name, nodes] : fine.node_sets) {
      std::vector<bool>& mask = masks_.emplace_back(fine.nodes_m.size(), false);
      for (const std::int32_t node : nodes) mask[node] = true;
      sets_.push_back(&nodes);
    }
  }

  /// `element`: nodes of the old element; i, j: two of its ten; x: node positions.
  std::int32_t find(std::span<const std::int32_t> element, std::span<const Vec3, 10> x, int i, int j) {
    const auto [low, high] = std::minmax(element[i], element[j]);
    const std::uint64_t key = (static_cast<std::uint64_t>(low) << 32) | static_cast<std::uint32_t>(high);
    const auto [found, is_new] = numbers_.try_emplace(key, static_cast<std::int32_t>(fine_.nodes_m.size()));
    if (!is_new) return found->second;
    Barycentric at = find_barycentric(i);
    const Barycentric other = find_barycentric(j);
    for (int k = 0; k < 4; ++k) at[k] = (at[k] + other[k]) / 2;
    fine_.nodes_m.push_back(map_point(x, at));
    if (!fine_.doubt_m.empty()) {
      Vec3 doubt{};
      for (int k = 0; k < 3; ++k) doubt[k] = 0.5 * (fine_.doubt_m[element[i]][k] + fine_.doubt_m[element[j]][k]);
      fine_.doubt_m.push_back(doubt);
    }
    join_sets(element, (1u << i) | (1u << j), found->second);
    return found->second;
  }

 private:
  void join_sets(std::span<const std::int32_t> element, std::uint32_t ends, std::int32_t node) {
    for (std::size_t s = 0; s < sets_.size(); ++s) {
      std::uint32_t held = 0;
      for (int i = 0; i < 10; ++i) held |= masks_[s][element[i]] ? 1u << i : 0u;
      const auto covers = [&](std::uint32_t part) { return (ends & ~part) == 0 && (part & ~held) == 0; };
      const bool on_edge = std::any_of(kEdgeBits.begin(), kEdgeBits.end(), [&](std::uint32_t edge) { return (ends & ~edge) == 0; });
      if (on_edge ? std::any_of(kEdgeBits.begin(), kEdgeBits.end(), covers) : std::any_of(kFaceBits.begin(), kFaceBits.end(), covers))
        sets_[s]->push_back(node);
    }
  }

  mesh::TetMesh& fine_;
  std::unordered_map<std::uint64_t, std::int32_t> numbers_;
  std::vector<std::vector<bool>> masks_;
  std::vector<std::vector<std::int32_t>*> sets_;
};

}  // namespace

mesh::TetMesh refine_mesh(const mesh::TetMesh& coarse) {
  const mesh::TetMesh old = coarse.order == 2 ? coarse : mesh::to_quadratic(coarse);
  mesh::TetMesh fine = old;
  fine.order = coarse.order;
  fine.tets.clear();
  fine.regions.clear();
  MiddleNodes middle(fine);
  for (std::int64_t e = 0; e < old.tet_count(); ++e) {
    const auto element = old.tet(e);
    std::array<Vec3, 10> x;
    for (int i = 0; i < 10; ++i) x[i] = old.nodes_m[element[i]];
    for (const auto& child : find_children(x)) {
      for (const int node : child) fine.tets.push_back(element[node]);
      for (const auto& [a, b] : mesh::kEdges)
        if (coarse.order == 2) fine.tets.push_back(middle.find(element, x, child[a], child[b]));
      fine.regions.push_back(old.regions[e]);
    }
  }
  return fine;
}

}  // namespace carillon::run
