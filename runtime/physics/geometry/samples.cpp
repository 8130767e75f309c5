// Method: all corners; chains of sharp edges simplified to polylines within a tolerance; vertices of curved parts and lattice points of
// their large triangles thinned by a hash grid with cells of 1/50 of the size (the point nearest to the cell centre represents the cell).
// Ball trees by halving along the longest side.
#include "runtime/physics/geometry/samples.hpp"

#include <cstdint>
#include <numeric>
#include <unordered_map>
#include <utility>

namespace carillon::geometry {
namespace {

constexpr double kSpacingRatio = 1.0 / 50.0;  // fraction of the size
constexpr double kStraightRatio = 5e-5;       // fraction of the size: maximum deviation of a polyline from its chain
constexpr int kSamplesInBall = 6;

/// Sorts items with centres and radii into a ball tree; `order` is permuted accordingly.
std::vector<Ball> make_tree(const std::vector<Vec3>& middles, const std::vector<double>& radii, std::vector<int>& order) {
  std::vector<Ball> tree;
  order.resize(middles.size());
  std::iota(order.begin(), order.end(), 0);
  if (middles.empty()) return tree;
  tree.push_back({{}, 0.0, 0, static_cast<int>(middles.size()), -1});
  for (std::size_t n = 0; n < tree.size(); ++n) {
    Ball ball = tree[n];
    Box box;
    for (int i = ball.first; i < ball.first + ball.count; ++i) box.add(middles[order[i]]);
    ball.middle = 0.5 * (box.low + box.high);
    for (int i = ball.first; i < ball.first + ball.count; ++i)
      ball.radius_m = std::max(ball.radius_m, norm(middles[order[i]] - ball.middle) + radii[order[i]]);
    if (ball.count > kSamplesInBall) {
      const Vec3 side = box.high - box.low;
      const int axis = side[0] >= side[1] && side[0] >= side[2] ? 0 : side[1] >= side[2] ? 1 : 2;
      const int half = ball.count / 2;
      const auto begin = order.begin() + ball.first;
      std::nth_element(begin, begin + half, begin + ball.count,
                       [&](int i, int j) { return middles[i][axis] != middles[j][axis] ? middles[i][axis] < middles[j][axis] : i < j; });
      ball.child = static_cast<int>(tree.size());
      tree.push_back({{}, 0.0, ball.first, half, -1});
      tree.push_back({{}, 0.0, ball.first + half, ball.count - half, -1});
    }
    tree[n] = ball;
  }
  return tree;
}

/// Chains of convex sharp edges between corners, as ordered half-edges.
std::vector<std::vector<int>> find_chains(const Mesh& mesh, const Skin& skin) {
  const int edges = 3 * mesh.count_faces();
  std::vector<char> open(edges, 0);
  std::vector<int> leaving(mesh.vertices.size(), 0);  // convex sharp half-edges at a vertex, both directions
  for (int e = 0; e < edges; ++e) {
    if (!skin.is_sharp(e) || !mesh.is_convex(e)) continue;
    open[e] = 1;
    ++leaving[mesh.vertex_of(e)];
  }
  const auto ends = [&](int v) { return skin.kind(v) == VertexKind::corner || leaving[v] != 2; };
  const auto follow = [&](int e) {  // next half-edge of the chain, or -1
    const int v = mesh.vertex_of(Mesh::next(e));
    if (ends(v)) return -1;
    const int start = Mesh::next(e);
    for (int g = start;;) {
      if (open[g] != 0 && g != mesh.opposite[e]) return g;
      g = Mesh::next(mesh.opposite[g]);
      if (g == start) return -1;
    }
  };
  std::vector<std::vector<int>> chains;
  for (const bool from_ends : {true, false}) {
    for (int e = 0; e < edges; ++e) {
      if (open[e] == 0 || (from_ends && !ends(mesh.vertex_of(e)))) continue;
      std::vector<int> chain;
      for (int g = e; g >= 0 && open[g] != 0;) {
        chain.push_back(g);
        const int further = follow(g);
        open[g] = open[mesh.opposite[g]] = 0;
        g = further;
      }
      chains.push_back(std::move(chain));
    }
  }
  return chains;
}

Ridge make_ridge(const Mesh& mesh, const std::vector<int>& chain, std::size_t first, std::size_t last) {
  Ridge ridge;
  ridge.vertices = {mesh.vertex_of(chain[first]), mesh.vertex_of(Mesh::next(chain[last]))};
  ridge.begin = mesh.vertices[ridge.vertices[0]];
  ridge.end = mesh.vertices[ridge.vertices[1]];
  ridge.along = normalise(ridge.end - ridge.begin);
  const int e = chain[(first + last) / 2];
  ridge.faces = {e / 3, mesh.opposite[e] / 3};
  ridge.into = {normalise(cross(mesh.normals[ridge.faces[0]], ridge.along)), normalise(cross(ridge.along, mesh.normals[ridge.faces[1]]))};
  return ridge;
}

/// Samples before they are sorted into their tree.
struct Draft {
  const Mesh& mesh;
  const Skin& skin;
  double size_m, spacing_m;
  std::vector<Sample> samples;
  std::vector<std::vector<int>> linked;  // neighbours of each sample
  std::vector<int> of_vertex;            // sample of each corner or ridge vertex; -1: none

  int add(const Vec3& x, VertexKind kind, int vertex, int face) {
    Sample s;
    s.point = x;
    s.kind = kind;
    s.vertex = vertex;
    s.face = face;
    samples.push_back(s);
    linked.emplace_back();
    return static_cast<int>(samples.size()) - 1;
  }
  void add_vertex(int v, VertexKind kind) {
    if (of_vertex[v] >= 0) return;
    of_vertex[v] = add(mesh.vertices[v], kind, v, skin.find_face(v));
  }
  void link(int p, int q) {
    if (p < 0 || q < 0 || p == q) return;
    linked[p].push_back(q);
    linked[q].push_back(p);
  }
};

/// Last edge of the straight piece of a chain that begins with edge `first`.
std::size_t find_straight_end(const Draft& draft, const std::vector<int>& chain, std::size_t first) {
  const Mesh& mesh = draft.mesh;
  std::size_t last = first;
  const Vec3& a = mesh.vertices[mesh.vertex_of(chain[first])];
  while (last + 1 < chain.size()) {
    const Vec3& b = mesh.vertices[mesh.vertex_of(Mesh::next(chain[last + 1]))];
    const double length2 = norm2(b - a);
    if (!(length2 > 0.0)) break;
    bool straight = true;
    const std::size_t between = last + 1 - first, step = 1 + between / 8;
    for (std::size_t i = first + 1; i <= last + 1 && straight; i += step) {
      const Vec3& x = mesh.vertices[mesh.vertex_of(chain[i])];
      straight = norm2(cross(x - a, b - a)) <= kStraightRatio * kStraightRatio * draft.size_m * draft.size_m * length2;
    }
    if (!straight) break;
    ++last;
  }
  return last;
}

/// Ridges of all chains; their vertices become samples.
std::vector<Ridge> add_ridges(Draft& draft) {
  std::vector<Ridge> ridges;
  for (const std::vector<int>& chain : find_chains(draft.mesh, draft.skin)) {
    for (std::size_t first = 0; first < chain.size();) {
      const std::size_t last = find_straight_end(draft, chain, first);
      ridges.push_back(make_ridge(draft.mesh, chain, first, last));
      for (const int v : ridges.back().vertices)
        if (draft.skin.kind(v) != VertexKind::none) draft.add_vertex(v, draft.skin.kind(v));
      first = last + 1;
    }
  }
  return ridges;
}

/// Intervals along the sides of a face's lattice, and the face's longest side.
std::pair<int, double> count_intervals(const Draft& draft, int f) {
  double longest = 0.0;
  for (int k = 0; k < 3; ++k) longest = std::max(longest, norm(draft.mesh.corner(f, (k + 1) % 3) - draft.mesh.corner(f, k)));
  return {std::clamp(static_cast<int>(std::ceil(longest / (1.5 * draft.spacing_m))), 1, 64), longest};
}

/// Barycentric weights of lattice point (i, j) with m intervals.
Vec3 calc_weights(int i, int j, int m) {
  return {1.0 - static_cast<double>(i + j) / m, static_cast<double>(i) / m, static_cast<double>(j) / m};
}

/// Smooth samples in a hash grid: the point nearest to the centre of its cell represents the cell.
class CellSamples {
 public:
  explicit CellSamples(Draft& draft) : draft_(draft), off_centre2_(draft.samples.size(), 0.0) {}

  /// The sample that represents x, a point of face f or of a vertex.
  int add(const Vec3& x, int vertex, int f) {
    const Vec3& low = draft_.mesh.box.low;
    std::uint64_t key = 0;
    Vec3 centre{};
    for (int k = 0; k < 3; ++k) {
      const double cell = std::floor((x[k] - low[k]) / draft_.spacing_m + 1.0);
      key = key << 21 | static_cast<std::uint64_t>(cell);
      centre[k] = low[k] + (cell - 0.5) * draft_.spacing_m;
    }
    const auto [found, fresh] = cells_.try_emplace(key, static_cast<int>(draft_.samples.size()));
    const double off = norm2(x - centre);
    if (fresh) {
      draft_.add(x, VertexKind::smooth, vertex, f);
      off_centre2_.push_back(off);
    } else if (off < off_centre2_[found->second]) {
      Sample& sample = draft_.samples[found->second];
      sample.point = x;
      sample.vertex = vertex;
      sample.face = f;
      off_centre2_[found->second] = off;
    }
    return found->second;
  }

 private:
  Draft& draft_;
  std::unordered_map<std::uint64_t, int> cells_;
  std::vector<double> off_centre2_;  // squared distance of each sample to its cell centre
};

/// Samples on the lattices of all curved faces, face by face.
std::vector<int> add_lattices(Draft& draft) {
  const Mesh& mesh = draft.mesh;
  CellSamples cells(draft);
  std::vector<int> lattices;
  for (int f = 0; f < mesh.count_faces(); ++f) {
    if (draft.skin.is_flat(f)) continue;
    const int m = count_intervals(draft, f).first;
    for (int i = 0; i <= m; ++i) {
      for (int j = 0; i + j <= m; ++j) {
        const Vec3 x = draft.skin.calc_point(f, calc_weights(i, j, m));
        int vertex = -1;
        if (i + j == 0) vertex = mesh.vertex_of(3 * f);
        if (i == m) vertex = mesh.vertex_of(3 * f + 1);
        if (j == m) vertex = mesh.vertex_of(3 * f + 2);
        const bool is_sharp = vertex >= 0 && draft.skin.kind(vertex) != VertexKind::smooth;
        lattices.push_back(is_sharp ? draft.of_vertex[vertex] : cells.add(x, vertex, f));
      }
    }
  }
  return lattices;
}

/// Sets the reach of the samples on lattices and links neighbours.
void link_lattices(Draft& draft, const std::vector<int>& lattices) {
  std::vector<int> lattice;
  std::size_t at = 0;
  for (int f = 0; f < draft.mesh.count_faces(); ++f) {
    if (draft.skin.is_flat(f)) continue;
    const auto [m, longest] = count_intervals(draft, f);
    lattice.assign((m + 1) * (m + 1), -1);
    for (int i = 0; i <= m; ++i) {
      for (int j = 0; i + j <= m; ++j, ++at) {
        const int s = lattices[at];
        lattice[i * (m + 1) + j] = s;
        if (s < 0) continue;
        const Vec3 x = draft.mesh.place(f, calc_weights(i, j, m));
        Sample& sample = draft.samples[s];
        sample.reach_m = std::max(sample.reach_m, norm(x - sample.point) + 0.6 * longest / m);
      }
    }
    for (int i = 0; i < m; ++i) {
      for (int j = 0; i + j < m; ++j) {
        const int here = lattice[i * (m + 1) + j], right = lattice[(i + 1) * (m + 1) + j], up = lattice[i * (m + 1) + j + 1];
        draft.link(here, right);
        draft.link(here, up);
        draft.link(right, up);
      }
    }
  }
}

/// Sorts ridges into the order of their tree.
std::vector<Ball> sort_ridges(std::vector<Ridge>& ridges) {
  std::vector<Vec3> middles;
  std::vector<double> radii;
  for (const Ridge& r : ridges) {
    middles.push_back(0.5 * (r.begin + r.end));
    radii.push_back(0.5 * norm(r.end - r.begin));
  }
  std::vector<int> order;
  std::vector<Ball> tree = make_tree(middles, radii, order);
  std::vector<Ridge> ordered;
  for (const int old : order) ordered.push_back(ridges[old]);
  ridges = std::move(ordered);
  return tree;
}

/// Lists the vertices of curved parts, edges and corners in the order of their tree.
std::vector<Ball> sort_vertices(const Mesh& mesh, const Skin& skin, std::vector<int>& vertices) {
  std::vector<int> listed, order;
  std::vector<Vec3> middles;
  for (int v = 0; v < mesh.count_vertices(); ++v)
    if (skin.kind(v) != VertexKind::none) listed.push_back(v), middles.push_back(mesh.vertices[v]);
  std::vector<Ball> tree = make_tree(middles, std::vector<double>(middles.size(), 0.0), order);
  for (const int at : order) vertices.push_back(listed[at]);
  return tree;
}

/// Fills the samples of `out` in the order of their tree, with their neighbours.
void sort_samples(Draft& draft, Samples& out) {
  std::vector<Vec3> middles;
  std::vector<double> radii;
  for (const Sample& s : draft.samples) {
    middles.push_back(s.point);
    radii.push_back(s.reach_m);
  }
  std::vector<int> order;
  out.sample_tree = make_tree(middles, radii, order);
  std::vector<int> moved(order.size());
  for (std::size_t i = 0; i < order.size(); ++i) moved[order[i]] = static_cast<int>(i);
  for (const int old : order) {
    Sample s = draft.samples[old];
    auto& near = draft.linked[old];
    std::sort(near.begin(), near.end());
    near.erase(std::unique(near.begin(), near.end()), near.end());
    s.first_neighbour = static_cast<int>(out.neighbours.size());
    s.neighbours = static_cast<int>(near.size());
    for (const int other : near) out.neighbours.push_back(moved[other]);
    if (s.kind == VertexKind::smooth) out.reach_m = std::max(out.reach_m, s.reach_m);
    out.samples.push_back(s);
  }
}

}  // namespace

Samples::Samples(const Mesh& mesh, const Skin& skin) {
  const double size = norm(mesh.box.high - mesh.box.low);
  spacing_m = kSpacingRatio * size;
  Draft draft{mesh, skin, size, spacing_m, {}, {}, std::vector<int>(mesh.vertices.size(), -1)};
  for (int v = 0; v < mesh.count_vertices(); ++v)
    if (skin.kind(v) == VertexKind::corner) draft.add_vertex(v, VertexKind::corner);
  ridges = add_ridges(draft);
  link_lattices(draft, add_lattices(draft));
  sort_samples(draft, *this);
  ridge_tree = sort_ridges(ridges);
  vertex_tree = sort_vertices(mesh, skin, vertices);
}

}  // namespace carillon::geometry
