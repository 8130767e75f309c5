// Method: corners are kept; chains of sharp edges become polylines within a tolerance; vertices of curved parts, and lattice points of
//   their large triangles, are thinned by a hash grid of 1/50 of the size, the place nearest to the middle of a cell for all in it. Trees
//   of balls by halving along the longest side.
#include "runtime/physics/geometry/samples.hpp"

#include <cstdint>
#include <numeric>
#include <unordered_map>
#include <utility>

namespace carillon::geometry {
namespace {

constexpr double kSpacing = 1.0 / 50.0;  // of the size
constexpr double kStraight = 5e-5;       // of the size: how far a polyline is off its chain
constexpr int kSamplesInBall = 6;

/// Halves things with middles and radii into a tree of balls; `order` becomes theirs.
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

/// Chains of convex sharp edges between corners, as half-edges in order.
std::vector<std::vector<int>> find_chains(const Mesh& mesh, const Skin& skin) {
  const int edges = 3 * mesh.count_faces();
  std::vector<char> open(edges, 0);
  std::vector<int> leaving(mesh.vertices.size(), 0);  // convex sharp half-edges, both ways, at a vertex
  for (int e = 0; e < edges; ++e) {
    if (!skin.is_sharp(e) || !mesh.is_convex(e)) continue;
    open[e] = 1;
    ++leaving[mesh.vertex_of(e)];
  }
  const auto ends = [&](int v) { return skin.kind(v) == VertexKind::corner || leaving[v] != 2; };
  const auto follow = [&](int e) {  // the next half-edge of the chain, or -1
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

}  // namespace

Samples::Samples(const Mesh& mesh, const Skin& skin) {
  const double size = norm(mesh.box.high - mesh.box.low);
  spacing_m = kSpacing * size;
  std::vector<Sample> made;
  std::vector<std::vector<int>> linked;
  std::vector<int> of_vertex(mesh.vertices.size(), -1);
  const auto add = [&](const Vec3& x, VertexKind kind, int vertex, int face) {
    Sample s;
    s.point = x;
    s.kind = kind;
    s.vertex = vertex;
    s.face = face;
    made.push_back(s);
    linked.emplace_back();
    return static_cast<int>(made.size()) - 1;
  };
  const auto add_vertex = [&](int v, VertexKind kind) {
    if (of_vertex[v] >= 0) return;
    of_vertex[v] = add(mesh.vertices[v], kind, v, skin.find_face(v));
  };
  for (int v = 0; v < mesh.count_vertices(); ++v)
    if (skin.kind(v) == VertexKind::corner) add_vertex(v, VertexKind::corner);

  for (const std::vector<int>& chain : find_chains(mesh, skin)) {
    for (std::size_t first = 0; first < chain.size();) {
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
          straight = norm2(cross(x - a, b - a)) <= kStraight * kStraight * size * size * length2;
        }
        if (!straight) break;
        ++last;
      }
      ridges.push_back(make_ridge(mesh, chain, first, last));
      for (const int v : ridges.back().vertices)
        if (skin.kind(v) != VertexKind::none) add_vertex(v, skin.kind(v));
      first = last + 1;
    }
  }

  std::unordered_map<std::uint64_t, int> cells;
  std::vector<double> off_middle(made.size(), 0.0);  // of its cell, squared
  std::vector<int> lattice, first_of_face(mesh.faces.size(), -1);
  const auto count_parts = [&](int f, double& longest) {
    longest = 0.0;
    for (int k = 0; k < 3; ++k) longest = std::max(longest, norm(mesh.corner(f, (k + 1) % 3) - mesh.corner(f, k)));
    return std::clamp(static_cast<int>(std::ceil(longest / (1.5 * spacing_m))), 1, 64);
  };
  std::vector<int> lattices;  // samples of the lattice points of all curved faces
  double longest = 0.0;
  for (int f = 0; f < mesh.count_faces(); ++f) {
    if (skin.is_flat(f)) continue;
    const int m = count_parts(f, longest);
    first_of_face[f] = static_cast<int>(lattices.size());
    for (int i = 0; i <= m; ++i) {
      for (int j = 0; i + j <= m; ++j) {
        const Vec3 x = skin.calc_point(f, {1.0 - static_cast<double>(i + j) / m, static_cast<double>(i) / m, static_cast<double>(j) / m});
        int vertex = -1;
        if (i + j == 0) vertex = mesh.vertex_of(3 * f);
        if (i == m) vertex = mesh.vertex_of(3 * f + 1);
        if (j == m) vertex = mesh.vertex_of(3 * f + 2);
        if (vertex >= 0 && skin.kind(vertex) != VertexKind::smooth) {
          lattices.push_back(of_vertex[vertex]);
          continue;
        }
        std::uint64_t key = 0;
        Vec3 middle{};
        for (int k = 0; k < 3; ++k) {
          const double cell = std::floor((x[k] - mesh.box.low[k]) / spacing_m + 1.0);
          key = key << 21 | static_cast<std::uint64_t>(cell);
          middle[k] = mesh.box.low[k] + (cell - 0.5) * spacing_m;
        }
        const auto [found, fresh] = cells.try_emplace(key, static_cast<int>(made.size()));
        const double off = norm2(x - middle);
        if (fresh) {
          add(x, VertexKind::smooth, vertex, f);
          off_middle.push_back(off);
        } else if (off < off_middle[found->second]) {
          Sample& sample = made[found->second];
          sample.point = x;
          sample.vertex = vertex;
          sample.face = f;
          off_middle[found->second] = off;
        }
        lattices.push_back(found->second);
      }
    }
  }
  for (int f = 0; f < mesh.count_faces(); ++f) {
    if (first_of_face[f] < 0) continue;
    const int m = count_parts(f, longest);
    lattice.assign((m + 1) * (m + 1), -1);
    for (int i = 0, at = first_of_face[f]; i <= m; ++i) {
      for (int j = 0; i + j <= m; ++j, ++at) {
        const int s = lattices[at];
        lattice[i * (m + 1) + j] = s;
        if (s < 0) continue;
        const Vec3 x = mesh.place(f, {1.0 - static_cast<double>(i + j) / m, static_cast<double>(i) / m, static_cast<double>(j) / m});
        made[s].reach_m = std::max(made[s].reach_m, norm(x - made[s].point) + 0.6 * longest / m);
      }
    }
    const auto link = [&](int p, int q) {
      if (p < 0 || q < 0 || p == q) return;
      linked[p].push_back(q);
      linked[q].push_back(p);
    };
    for (int i = 0; i < m; ++i) {
      for (int j = 0; i + j < m; ++j) {
        const int here = lattice[i * (m + 1) + j], right = lattice[(i + 1) * (m + 1) + j], up = lattice[i * (m + 1) + j + 1];
        link(here, right);
        link(here, up);
        link(right, up);
      }
    }
  }

  std::vector<Vec3> middles;
  std::vector<double> radii;
  std::vector<int> order;
  for (const Sample& s : made) {
    middles.push_back(s.point);
    radii.push_back(s.reach_m);
  }
  sample_tree = make_tree(middles, radii, order);
  std::vector<int> moved(made.size());
  for (std::size_t i = 0; i < order.size(); ++i) moved[order[i]] = static_cast<int>(i);
  for (const int old : order) {
    Sample s = made[old];
    auto& near = linked[old];
    std::sort(near.begin(), near.end());
    near.erase(std::unique(near.begin(), near.end()), near.end());
    s.first_neighbour = static_cast<int>(neighbours.size());
    s.neighbours = static_cast<int>(near.size());
    for (const int other : near) neighbours.push_back(moved[other]);
    if (s.kind == VertexKind::smooth) reach_m = std::max(reach_m, s.reach_m);
    samples.push_back(s);
  }
  middles.clear();
  radii.clear();
  for (const Ridge& r : ridges) {
    middles.push_back(0.5 * (r.begin + r.end));
    radii.push_back(0.5 * norm(r.end - r.begin));
  }
  ridge_tree = make_tree(middles, radii, order);
  std::vector<Ridge> ordered;
  for (const int old : order) ordered.push_back(ridges[old]);
  ridges = std::move(ordered);

  middles.clear();
  for (int v = 0; v < mesh.count_vertices(); ++v)
    if (skin.kind(v) != VertexKind::none) vertices.push_back(v), middles.push_back(mesh.vertices[v]);
  radii.assign(middles.size(), 0.0);
  vertex_tree = make_tree(middles, radii, order);
  for (int& at : order) at = vertices[at];
  vertices = std::move(order);
}

}  // namespace carillon::geometry
