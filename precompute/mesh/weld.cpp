// Method: nodes are sorted into grid cells a thousand times coarser than the tolerance; twins are joined transitively. Twins are welded
//   only where two boundary faces coincide corner by corner, so that bodies touching at a point or along an edge stay apart. Tolerance:
//   1e-6 of the box diagonal of the used nodes, at most 0.01 of the shortest edge, at least calc_place_tolerance.

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "precompute/mesh/check_parts.hpp"
#include "precompute/mesh/faces.hpp"
#include "precompute/mesh/parts.hpp"
#include "runtime/base/error.hpp"

namespace carillon::mesh {

namespace {

/// Joins used nodes within `tolerance` of each other; true if there are any.
bool join_twins(const TetMesh& mesh, const std::vector<char>& used, const Vec3& low, double tolerance, Parts& twins) {
  const double cell = 1000.0 * tolerance;
  struct Entry {
    std::uint64_t key;
    std::int32_t node;
  };
  const auto key_of = [](const std::array<std::int64_t, 3>& at) {
    return static_cast<std::uint64_t>(at[0]) << 42 | static_cast<std::uint64_t>(at[1]) << 21 | static_cast<std::uint64_t>(at[2]);
  };
  const auto cell_of = [&](double x, double origin) { return 1 + static_cast<std::int64_t>(std::floor((x - origin) / cell)); };
  std::vector<Entry> entries;
  for (std::size_t i = 0; i < mesh.nodes_m.size(); ++i) {
    if (used[i] == 0) continue;
    const Vec3& x = mesh.nodes_m[i];
    entries.push_back({key_of({cell_of(x[0], low[0]), cell_of(x[1], low[1]), cell_of(x[2], low[2])}), static_cast<std::int32_t>(i)});
  }
  std::sort(entries.begin(), entries.end(),
            [](const Entry& a, const Entry& b) { return a.key < b.key || (a.key == b.key && a.node < b.node); });
  bool any = false;
  const auto compare = [&](std::int32_t i, std::int32_t j) {
    const Vec3& x = mesh.nodes_m[i];
    const Vec3& y = mesh.nodes_m[j];
    if (i == j || calc_length(x - y) > tolerance) return;
    twins.join(i, j);
    any = true;
  };
  for (std::size_t n = 0; n < entries.size(); ++n) {
    for (std::size_t m = n + 1; m < entries.size() && entries[m].key == entries[n].key; ++m) compare(entries[n].node, entries[m].node);
    const Vec3& x = mesh.nodes_m[entries[n].node];
    std::array<std::int64_t, 3> from{}, to{};
    for (std::size_t k = 0; k < 3; ++k) {
      from[k] = cell_of(x[k] - tolerance, low[k]);
      to[k] = cell_of(x[k] + tolerance, low[k]);
    }
    if (from == to) continue;  // usual case: the node is away from its cell's border
    for (std::int64_t i = from[0]; i <= to[0]; ++i)
      for (std::int64_t j = from[1]; j <= to[1]; ++j)
        for (std::int64_t k = from[2]; k <= to[2]; ++k) {
          const std::uint64_t key = key_of({i, j, k});
          auto other = std::lower_bound(entries.begin(), entries.end(), key, [](const Entry& a, std::uint64_t b) { return a.key < b; });
          for (; other != entries.end() && other->key == key; ++other) compare(entries[n].node, other->node);
        }
  }
  return any;
}

/// Marks the corners and mid nodes of boundary faces that coincide after merging twins.
void mark_cracks(const TetMesh& mesh, const std::vector<std::int32_t>& twin_of, std::vector<char>& marked) {
  // Exclude faces that are already shared.
  std::vector<char> single(4 * mesh.tet_count(), 0);
  const auto slot = [](const Face& face) { return static_cast<std::size_t>(4 * static_cast<std::int64_t>(face.tet) + face.local); };
  {
    const auto faces = sort_faces(mesh);
    for (std::size_t i = 0; i < faces.size(); ++i) {
      const bool before = i > 0 && same_corners(faces[i - 1], faces[i]);
      const bool after = i + 1 < faces.size() && same_corners(faces[i], faces[i + 1]);
      single[slot(faces[i])] = !before && !after;
    }
  }
  const auto faces = sort_faces(mesh, twin_of);
  for (std::size_t i = 1; i < faces.size(); ++i) {
    if (!same_corners(faces[i - 1], faces[i]) || single[slot(faces[i - 1])] == 0 || single[slot(faces[i])] == 0) continue;
    for (const Face& face : {faces[i - 1], faces[i]}) {
      const auto tet = mesh.tet(face.tet);
      const auto corners = kFaces[face.local];
      for (std::size_t k = 0; k < 3; ++k) {
        marked[tet[corners[k]]] = 1;
        if (mesh.order == 2) marked[tet[4 + find_edge(corners[k], corners[(k + 1) % 3])]] = 1;
      }
    }
  }
}

struct MidNode {
  std::int32_t high;  // greater corner of the edge
  std::int32_t mid;
  std::int32_t tet;
};

/// Every edge of a quadratic mesh has one mid node: marks twins for welding; refuses different positions.
void match_mid_nodes(const TetMesh& mesh, const std::string& name, const std::vector<std::int32_t>& twin_of,
                     const std::vector<std::int32_t>& corner_of, std::vector<char>& marked) {
  std::vector<std::size_t> begin(mesh.nodes_m.size() + 1, 0);
  const auto ends = [&](std::int64_t e, std::size_t k) {
    const auto tet = mesh.tet(e);
    const auto a = corner_of[tet[kEdges[k][0]]];
    const auto b = corner_of[tet[kEdges[k][1]]];
    return std::pair{std::min(a, b), std::max(a, b)};
  };
  for (std::int64_t e = 0; e < mesh.tet_count(); ++e)
    for (std::size_t k = 0; k < 6; ++k) ++begin[ends(e, k).first + 1];
  for (std::size_t i = 1; i < begin.size(); ++i) begin[i] += begin[i - 1];
  std::vector<MidNode> edges(6 * mesh.tet_count());
  std::vector<std::size_t> next(begin.begin(), begin.end() - 1);
  std::vector<std::array<std::int32_t, 2>> edge_of(mesh.nodes_m.size(), {-1, -1});
  for (std::int64_t e = 0; e < mesh.tet_count(); ++e)
    for (std::size_t k = 0; k < 6; ++k) {
      const auto [low, high] = ends(e, k);
      const auto mid = mesh.tet(e)[4 + k];
      edges[next[low]++] = {high, mid, static_cast<std::int32_t>(e)};
      auto& known = edge_of[mid];
      if (known[0] >= 0 && known != std::array{low, high})
        throw InputError(fmt::format(
            "{}: node {} is the mid node of two different edges (one of them in element {}); write the quadratic mesh again, in the "
            "node order of its format",
            name, mid + 1, e + 1));
      known = {low, high};
    }
  for (std::int64_t e = 0; e < mesh.tet_count(); ++e)
    for (std::size_t k = 0; k < 4; ++k)
      if (edge_of[mesh.tet(e)[k]][0] >= 0)
        throw InputError(fmt::format(
            "{}: node {} is a corner of element {} and the mid node of another; write the quadratic mesh again, in the node order of "
            "its format",
            name, mesh.tet(e)[k] + 1, e + 1));
  for (std::size_t low = 0; low + 1 < begin.size(); ++low) {
    const auto first = edges.begin() + static_cast<std::ptrdiff_t>(begin[low]);
    const auto last = edges.begin() + static_cast<std::ptrdiff_t>(begin[low + 1]);
    std::sort(first, last, [](const MidNode& x, const MidNode& y) { return x.high < y.high || (x.high == y.high && x.tet < y.tet); });
    for (auto edge = first; edge != last; ++edge) {
      if (edge == first || edge->high != (edge - 1)->high || edge->mid == (edge - 1)->mid) continue;
      const auto before = edge - 1;
      if (twin_of[edge->mid] != twin_of[before->mid])
        throw InputError(fmt::format(
            "{}: elements {} and {} share the edge of nodes {} and {}, but have different mid nodes ({} and {}) on it; write the "
            "quadratic mesh again with one node per edge",
            name, before->tet + 1, edge->tet + 1, low + 1, edge->high + 1, before->mid + 1, edge->mid + 1));
      marked[edge->mid] = marked[before->mid] = 1;
    }
  }
}

/// Shortest distance between corners of an element [m].
double find_shortest_edge(const TetMesh& mesh) {
  double shortest = HUGE_VAL;
  for (std::int64_t e = 0; e < mesh.tet_count(); ++e) {
    const auto tet = mesh.tet(e);
    for (const auto& [i, j] : kEdges) {
      const Vec3 &a = mesh.nodes_m[tet[i]], &b = mesh.nodes_m[tet[j]];
      shortest = std::min(shortest, calc_length(a - b));
    }
  }
  return shortest;
}

}  // namespace

std::vector<std::int32_t> weld_cracks(TetMesh& mesh, const std::string& name, CheckReport& report) {
  const std::size_t count = mesh.nodes_m.size();
  std::vector<char> used(count, 0);
  for (const auto node : mesh.tets) used[node] = 1;
  Vec3 low{HUGE_VAL, HUGE_VAL, HUGE_VAL}, high{-HUGE_VAL, -HUGE_VAL, -HUGE_VAL};
  for (std::size_t i = 0; i < count; ++i)
    for (std::size_t k = 0; used[i] != 0 && k < 3; ++k) {
      low[k] = std::min(low[k], mesh.nodes_m[i][k]);
      high[k] = std::max(high[k], mesh.nodes_m[i][k]);
    }
  if (!std::isfinite(calc_length(high - low)))
    throw InputError(fmt::format("{}: the coordinates are too large to compute with; give them in metres", name));
  // Single-precision coordinates differ by 1e-7 of the body; nodes that close relative to an element are still distinct.
  constexpr double kSingle = 1e-6, kOfEdge = 1e-2;
  const double diagonal = calc_length(high - low);
  const double tolerance = std::max(calc_place_tolerance(low, high), std::min(kSingle * diagonal, kOfEdge * find_shortest_edge(mesh)));
  Parts twins(count);
  const bool any = tolerance > 0.0 && join_twins(mesh, used, low, tolerance, twins);
  std::vector<std::int32_t> identity(count), twin_of(count);
  for (std::size_t i = 0; i < count; ++i) {
    identity[i] = static_cast<std::int32_t>(i);
    twin_of[i] = twins.find(identity[i]);
  }
  if (!any) {
    std::vector<char> marked(count, 0);
    if (mesh.order == 2) match_mid_nodes(mesh, name, twin_of, identity, marked);
    return identity;
  }
  // Twins within one element are no crack: the element has zero volume and is refused later.
  std::vector<char> barred(count, 0);
  for (std::int64_t e = 0; e < mesh.tet_count(); ++e) {
    const auto tet = mesh.tet(e);
    for (std::size_t i = 0; i < tet.size(); ++i)
      for (std::size_t j = 0; j < i; ++j)
        if (twin_of[tet[i]] == twin_of[tet[j]]) barred[twin_of[tet[i]]] = 1;
  }
  for (std::size_t i = 0; i < count; ++i)
    if (barred[twins.find(identity[i])] != 0) twin_of[i] = identity[i];
  std::vector<char> marked(count, 0);
  mark_cracks(mesh, twin_of, marked);
  // The first marked twin is the representative.
  const auto choose = [&] {
    std::vector<std::int32_t> first(count, -1), stand(identity);
    for (std::size_t i = 0; i < count; ++i) {
      if (marked[i] == 0) continue;
      auto& chosen = first[twin_of[i]];
      if (chosen < 0) chosen = identity[i];
      stand[i] = chosen;
    }
    return stand;
  };
  std::vector<std::int32_t> stand = choose();
  if (mesh.order == 2) {
    match_mid_nodes(mesh, name, twin_of, stand, marked);
    stand = choose();
  }
  for (std::size_t i = 0; i < count; ++i) {
    report.welded += stand[i] != identity[i];
    report.touching_nodes += used[i] != 0 && stand[i] == identity[i] && twin_of[i] != identity[i] && stand[twin_of[i]] != stand[i];
  }
  for (auto& node : mesh.tets) node = stand[node];
  return stand;
}

}  // namespace carillon::mesh
