// Method: an edge or node where the boundary is not a surface joins several groups of elements without common faces there; all but the
//   largest group are removed, iterated until none is left.
#include "precompute/mesher/tet_quality.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <numbers>
#include <numeric>
#include <set>
#include <unordered_map>

#include "precompute/mesh/check.hpp"
#include "precompute/mesh/curved.hpp"

namespace carillon::mesher {
namespace {

struct KeyHash {
  template <std::size_t N>
  std::size_t operator()(const std::array<std::int32_t, N>& key) const {
    std::size_t h = 0;
    for (const std::int32_t v : key) h = (h ^ static_cast<std::size_t>(v)) * 0x9E3779B97F4A7C15ull;
    return h ^ (h >> 31);
  }
};

template <std::size_t N>
std::array<std::int32_t, N> sorted(std::array<std::int32_t, N> key) {
  std::sort(key.begin(), key.end());
  return key;
}

Triangle get_face(const mesh::TetMesh& mesh, std::int64_t e, int face) {
  const auto tet = mesh.tet(e);
  return {tet[mesh::kFaces[face][0]], tet[mesh::kFaces[face][1]], tet[mesh::kFaces[face][2]]};
}

/// Neighbour across each face of each element; -1 at the boundary.
std::vector<std::array<std::int32_t, 4>> find_neighbours(const mesh::TetMesh& mesh) {
  std::vector<std::array<std::int32_t, 4>> neighbours(mesh.tet_count(), {-1, -1, -1, -1});
  // Faces bucketed by lowest node; few share one, so twins are found by linear search.
  struct Entry {
    std::int32_t middle, high, element;
    int face;
  };
  std::vector<std::size_t> begin(mesh.nodes_m.size() + 1, 0);
  for (std::int32_t e = 0; e < mesh.tet_count(); ++e)
    for (int f = 0; f < 4; ++f) ++begin[sorted(get_face(mesh, e, f))[0] + 1];
  for (std::size_t v = 1; v < begin.size(); ++v) begin[v] += begin[v - 1];
  std::vector<Entry> entries(begin.back());
  std::vector<std::size_t> end(begin.begin(), begin.end() - 1);
  for (std::int32_t e = 0; e < mesh.tet_count(); ++e)
    for (int f = 0; f < 4; ++f) {
      const Triangle key = sorted(get_face(mesh, e, f));
      const std::size_t bucket = key[0];
      std::size_t n = begin[bucket];
      while (n < end[bucket] && (entries[n].middle != key[1] || entries[n].high != key[2])) ++n;
      if (n == end[bucket]) {
        entries[end[bucket]++] = {key[1], key[2], e, f};
        continue;
      }
      const Entry twin = entries[n];
      neighbours[e][f] = twin.element;
      neighbours[twin.element][twin.face] = e;
      entries[n] = entries[--end[bucket]];
    }
  return neighbours;
}

/// Groups of `around` (elements that share a node or edge) connected by faces that contain all of `shared`.
template <std::size_t N>
std::vector<std::vector<std::int32_t>> find_groups(const mesh::TetMesh& mesh, const std::vector<std::array<std::int32_t, 4>>& neighbours,
                                                   const std::vector<std::int32_t>& around, const std::array<std::int32_t, N>& shared) {
  std::vector<std::vector<std::int32_t>> groups;
  std::vector<std::int32_t> left = around;
  while (!left.empty()) {
    std::vector<std::int32_t> group{left.back()};
    left.pop_back();
    for (std::size_t next = 0; next < group.size(); ++next)
      for (int f = 0; f < 4; ++f) {
        const std::int32_t other = neighbours[group[next]][f];
        const Triangle face = get_face(mesh, group[next], f);
        const bool holds =
            std::all_of(shared.begin(), shared.end(), [&](std::int32_t v) { return std::find(face.begin(), face.end(), v) != face.end(); });
        const auto found = other >= 0 && holds ? std::find(left.begin(), left.end(), other) : left.end();
        if (found == left.end()) continue;
        group.push_back(other);
        left.erase(found);
      }
    groups.push_back(group);
  }
  std::stable_sort(groups.begin(), groups.end(), [](const auto& a, const auto& b) { return a.size() > b.size(); });
  return groups;
}

/// Elements to remove to make the boundary a surface around edges and nodes; empty if it is one.
std::vector<char> find_pinching(const mesh::TetMesh& mesh, const std::vector<std::array<std::int32_t, 4>>& neighbours, bool& any) {
  std::vector<char> remove(neighbours.size(), 0);
  any = false;
  // Only boundary nodes and edges can be pinched.
  std::unordered_map<Edge, int, KeyHash> boundary_edges;
  std::vector<char> on_boundary(mesh.nodes_m.size(), 0);
  for (std::int32_t e = 0; e < mesh.tet_count(); ++e)
    for (int f = 0; f < 4; ++f) {
      if (neighbours[e][f] >= 0) continue;
      const Triangle face = get_face(mesh, e, f);
      for (int c = 0; c < 3; ++c) {
        ++boundary_edges[sorted(Edge{face[c], face[(c + 1) % 3]})];
        on_boundary[face[c]] = 1;
      }
    }
  std::vector<std::vector<std::int32_t>> at_node(mesh.nodes_m.size());
  for (std::int32_t e = 0; e < mesh.tet_count(); ++e)
    for (const std::int32_t v : mesh.tet(e).first(4))
      if (on_boundary[v]) at_node[v].push_back(e);
  const auto remove_small = [&](const std::vector<std::vector<std::int32_t>>& groups) {
    for (std::size_t g = 1; g < groups.size(); ++g)
      for (const std::int32_t e : groups[g]) remove[e] = 1, any = true;
  };
  for (const auto& [edge, count] : boundary_edges) {
    if (count == 2) continue;
    std::vector<std::int32_t> around;
    for (const std::int32_t e : at_node[edge[0]]) {
      const auto tet = mesh.tet(e);
      if (std::find(tet.begin(), tet.end(), edge[1]) != tet.end()) around.push_back(e);
    }
    remove_small(find_groups(mesh, neighbours, around, edge));
  }
  if (any) return remove;
  for (std::int32_t v = 0; v < static_cast<std::int32_t>(mesh.nodes_m.size()); ++v)
    if (on_boundary[v]) remove_small(find_groups(mesh, neighbours, at_node[v], std::array{v}));
  return remove;
}

/// Marks the elements of all but the `components` largest pieces.
std::vector<char> find_crumbs(const std::vector<std::array<std::int32_t, 4>>& neighbours, std::int64_t components, bool& any) {
  std::vector<std::int32_t> piece(neighbours.size(), -1);
  std::vector<std::pair<std::int64_t, std::int32_t>> sizes;  // negative size: sorts the largest first
  for (std::size_t seed = 0; seed < neighbours.size(); ++seed) {
    if (piece[seed] >= 0) continue;
    const auto number = static_cast<std::int32_t>(sizes.size());
    std::vector<std::int32_t> reached{static_cast<std::int32_t>(seed)};
    piece[seed] = number;
    for (std::size_t next = 0; next < reached.size(); ++next)
      for (const std::int32_t other : neighbours[reached[next]])
        if (other >= 0 && piece[other] < 0) piece[other] = number, reached.push_back(other);
    sizes.emplace_back(-static_cast<std::int64_t>(reached.size()), number);
  }
  any = static_cast<std::int64_t>(sizes.size()) > components;
  std::vector<char> remove(neighbours.size(), 0);
  if (!any) return remove;
  std::sort(sizes.begin(), sizes.end());
  std::vector<char> keep(sizes.size(), 0);
  for (std::int64_t c = 0; c < components; ++c) keep[sizes[c].second] = 1;
  for (std::size_t e = 0; e < remove.size(); ++e) remove[e] = keep[piece[e]] ? 0 : 1;
  return remove;
}

}  // namespace

TetMeasures measure(const mesh::TetMesh& mesh) {
  TetMeasures out;
  double edges = 0;
  for (std::int64_t e = 0; e < mesh.tet_count(); ++e) {
    const auto tet = mesh.tet(e);
    std::array<Vec3, 4> p, normal;
    for (int c = 0; c < 4; ++c) p[c] = mesh.nodes_m[tet[c]];
    for (int f = 0; f < 4; ++f) {
      const auto& corner = mesh::kFaces[f];
      normal[f] = cross(p[corner[1]] - p[corner[0]], p[corner[2]] - p[corner[0]]);
    }
    for (int i = 0; i < 4; ++i)
      for (int j = i + 1; j < 4; ++j) {
        const double angle = 180 - std::atan2(norm(cross(normal[i], normal[j])), dot(normal[i], normal[j])) * 180 / std::numbers::pi;
        out.min_dihedral_deg = std::min(out.min_dihedral_deg, angle);
        out.max_dihedral_deg = std::max(out.max_dihedral_deg, angle);
        edges += norm(p[j] - p[i]);
      }
    out.volume_m3 += dot(p[1] - p[0], cross(p[2] - p[0], p[3] - p[0])) / 6;
  }
  out.mean_edge_m = mesh.tet_count() > 0 ? edges / (6.0 * static_cast<double>(mesh.tet_count())) : 0;
  return out;
}

double calc_mesh_volume(const mesh::TetMesh& mesh) {
  if (mesh.order == 1) return measure(mesh).volume_m3;
  double sum = 0;
  for (std::int64_t e = 0; e < mesh.tet_count(); ++e) sum += mesh::calc_curved_volume(mesh, e);
  return sum;
}

std::vector<Triangle> find_boundary(const mesh::TetMesh& mesh) {
  const auto neighbours = find_neighbours(mesh);
  std::vector<Triangle> out;
  for (std::int32_t e = 0; e < mesh.tet_count(); ++e)
    for (int f = 0; f < 4; ++f)
      if (neighbours[e][f] < 0) out.push_back(get_face(mesh, e, f));
  return out;
}

std::int64_t count_pinches(const std::vector<Triangle>& faces) {
  struct Side {
    Edge ends;
    std::int32_t face;
  };
  std::vector<Side> sides;
  sides.reserve(3 * faces.size());
  std::int32_t top = 0;
  for (std::size_t f = 0; f < faces.size(); ++f)
    for (int c = 0; c < 3; ++c) {
      sides.push_back({sorted(Edge{faces[f][c], faces[f][(c + 1) % 3]}), static_cast<std::int32_t>(f)});
      top = std::max(top, faces[f][c] + 1);
    }
  std::sort(sides.begin(), sides.end(), [](const Side& a, const Side& b) { return a.ends < b.ends; });
  // Corners of faces at a node, joined across common edges: one group per node.
  std::vector<std::int32_t> leader(3 * faces.size());
  std::iota(leader.begin(), leader.end(), 0);
  const auto find_leader = [&](std::int32_t n) {
    while (leader[n] != n) n = leader[n] = leader[leader[n]];
    return n;
  };
  const auto find_corner = [&](std::int32_t f, std::int32_t v) {
    return 3 * f + static_cast<std::int32_t>(std::find(faces[f].begin(), faces[f].end(), v) - faces[f].begin());
  };
  auto groups = static_cast<std::int64_t>(leader.size());
  std::int64_t pinches = 0;
  for (std::size_t n = 0, end = 0; n < sides.size(); n = end) {
    for (end = n; end < sides.size() && sides[end].ends == sides[n].ends;) ++end;
    pinches += end - n != 2;
    // At an edge of several sheets any pairing works: it is a pinch already.
    for (std::size_t k = n + 1; k < end; ++k)
      for (const std::int32_t v : sides[n].ends) {
        const std::int32_t a = find_leader(find_corner(sides[n].face, v)), b = find_leader(find_corner(sides[k].face, v));
        if (a != b) leader[a] = b, --groups;
      }
  }
  std::vector<char> used(top, 0);
  for (const Triangle& face : faces)
    for (const std::int32_t v : face) used[v] = 1;
  return pinches + groups - std::count(used.begin(), used.end(), 1);
}

std::int64_t count_edges(const mesh::TetMesh& mesh) {
  std::vector<Edge> edges;
  edges.reserve(mesh.tet_count() * 6);
  for (std::int64_t e = 0; e < mesh.tet_count(); ++e)
    for (const auto& [a, b] : mesh::kEdges) edges.push_back(sorted(Edge{mesh.tet(e)[a], mesh.tet(e)[b]}));
  std::sort(edges.begin(), edges.end());
  return std::unique(edges.begin(), edges.end()) - edges.begin();
}

void drop_elements(mesh::TetMesh& mesh, const std::vector<char>& remove) {
  std::vector<std::int32_t> number(mesh.nodes_m.size(), -1), tets;
  std::vector<Vec3> nodes;
  for (std::int64_t e = 0; e < mesh.tet_count(); ++e) {
    if (remove[e]) continue;
    for (const std::int32_t v : mesh.tet(e)) {
      if (number[v] < 0) {
        number[v] = static_cast<std::int32_t>(nodes.size());
        nodes.push_back(mesh.nodes_m[v]);
      }
      tets.push_back(number[v]);
    }
  }
  mesh.nodes_m = std::move(nodes);
  mesh.tets = std::move(tets);
  mesh.regions.assign(mesh.tet_count(), 0);
}

std::int64_t make_manifold(mesh::TetMesh& mesh, std::int64_t components) {
  const std::int64_t before = mesh.tet_count();
  for (bool any = true; any && mesh.tet_count() > 0;) {
    const auto neighbours = find_neighbours(mesh);
    auto remove = find_pinching(mesh, neighbours, any);
    if (!any) remove = find_crumbs(neighbours, components, any);
    if (any) drop_elements(mesh, remove);
  }
  return before - mesh.tet_count();
}

double calc_flatness(const std::array<Vec3, 4>& corners) {
  const auto& p = corners;
  if (!(dot(p[1] - p[0], cross(p[2] - p[0], p[3] - p[0])) > 0)) return -1;
  std::array<Vec3, 4> normal;
  for (int f = 0; f < 4; ++f)
    normal[f] = cross(p[mesh::kFaces[f][1]] - p[mesh::kFaces[f][0]], p[mesh::kFaces[f][2]] - p[mesh::kFaces[f][0]]);
  std::array<double, 4> square;
  for (int f = 0; f < 4; ++f) square[f] = dot(normal[f], normal[f]);
  double max = 0;  // squared cosine of the flattest angle
  for (int i = 0; i < 4; ++i)
    for (int j = i + 1; j < 4; ++j) {
      const double product = dot(normal[i], normal[j]);
      max = std::max(max, product * product / (square[i] * square[j]));
    }
  return std::acos(std::sqrt(std::min(max, 1.0))) * 180 / std::numbers::pi;
}

std::int64_t peel_flat_elements(mesh::TetMesh& mesh) {
  constexpr double kMinDihedralDeg = 1e-3;
  std::int64_t peeled = 0;
  while (mesh::count_flat(mesh) > 0) {
    std::set<Triangle> boundary;  // corners ascending
    for (Triangle face : find_boundary(mesh)) {
      std::sort(face.begin(), face.end());
      boundary.insert(face);
    }
    std::vector<char> remove(mesh.tet_count(), 0);
    std::int64_t count = 0;
    for (std::int64_t e = 0; e < mesh.tet_count(); ++e) {
      const auto tet = mesh.tet(e);
      std::array<Vec3, 4> corners;
      for (int c = 0; c < 4; ++c) corners[c] = mesh.nodes_m[tet[c]];
      if (std::abs(calc_flatness(corners)) > kMinDihedralDeg) continue;
      const bool is_outer = std::any_of(std::begin(mesh::kFaces), std::end(mesh::kFaces), [&](const auto& face) {
        Triangle key{tet[face[0]], tet[face[1]], tet[face[2]]};
        std::sort(key.begin(), key.end());
        return boundary.contains(key);
      });
      if (!is_outer) continue;
      remove[e] = 1;
      ++count;
    }
    if (count == 0) break;
    drop_elements(mesh, remove);
    peeled += count;
  }
  return peeled;
}

}  // namespace carillon::mesher
