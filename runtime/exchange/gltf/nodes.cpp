// Method: column-vector matrices T R S.
// Source: glTF 2.0 specification, chapter 3.5.3.
// Deviations: rotations are normalised to unit quaternions.
#include "runtime/exchange/gltf/nodes.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "runtime/exchange/gltf/file.hpp"

namespace carillon::gltf {
namespace {

constexpr std::size_t kMaxNodes = 10'000'000;
constexpr double kScaleTolerance = 1e-4;  // relative difference between the axes of a node

/// Indices in a list of `owner`, which may be missing.
std::vector<std::size_t> read_nodes(base::Object& owner, const char* key, std::size_t count) {
  std::vector<std::size_t> list;
  if (!owner.has(key) || owner.is_empty_list(key)) return list;
  for (const double number : owner.number_list(key, kMaxNodes)) {
    if (!(number >= 0.0 && number < static_cast<double>(count) && number == std::floor(number)))
      owner.fail(key, fmt::format("names node {:g}, and there are {}; export it again", number, count));
    list.push_back(static_cast<std::size_t>(number));
  }
  return list;
}

/// `roots` with all below them, parents first. Every node has one parent at most, so that those of a cycle are never reached.
std::vector<std::size_t> list_below(const std::vector<std::size_t>& roots, const std::vector<std::vector<std::size_t>>& children) {
  std::vector<std::size_t> list, waiting(roots.rbegin(), roots.rend());
  while (!waiting.empty()) {
    const std::size_t n = waiting.back();
    waiting.pop_back();
    list.push_back(n);
    waiting.insert(waiting.end(), children[n].rbegin(), children[n].rend());
  }
  return list;
}

}  // namespace

Matrix multiply(const Matrix& a, const Matrix& b) {
  Matrix c{};
  for (int j = 0; j < 4; ++j)
    for (int i = 0; i < 4; ++i)
      for (int k = 0; k < 4; ++k) c[4 * j + i] += a[4 * k + i] * b[4 * j + k];
  return c;
}

Vec3 move(const Matrix& m, const Vec3& p) {
  Vec3 q{m[12], m[13], m[14]};
  for (int i = 0; i < 3; ++i)
    for (int k = 0; k < 3; ++k) q[i] += m[4 * k + i] * p[k];
  return q;
}

double calc_determinant(const Matrix& m) { return dot(Vec3{m[0], m[1], m[2]}, cross(Vec3{m[4], m[5], m[6]}, Vec3{m[8], m[9], m[10]})); }

std::optional<double> find_scale(const Matrix& m) {
  const Vec3 x{m[0], m[1], m[2]}, y{m[4], m[5], m[6]}, z{m[8], m[9], m[10]};
  const double scale = std::cbrt(calc_determinant(m));
  if (!(scale > 0.0 && std::isfinite(scale))) return std::nullopt;
  const double most = kScaleTolerance * scale;
  for (const Vec3& axis : {x, y, z})
    if (!(std::abs(norm(axis) - scale) <= most)) return std::nullopt;
  for (const double off : {dot(x, y), dot(y, z), dot(z, x)})
    if (!(std::abs(off) <= most * scale)) return std::nullopt;
  return scale;
}

Graph read_graph(base::Object& root) {
  Graph graph;
  graph.nodes = root.objects("nodes");
  const std::size_t count = graph.nodes.size();
  graph.parent.resize(count);
  graph.children.resize(count);
  graph.global.resize(count, kIdentity);
  for (std::size_t n = 0; n < count; ++n) {
    graph.children[n] = read_nodes(graph.nodes[n], "children", count);
    for (const std::size_t child : graph.children[n]) {
      if (graph.parent[child])
        graph.nodes[n].fail(
            "children", fmt::format("names node {}, which is a child of node {} already; export it again", child, *graph.parent[child]));
      graph.parent[child] = n;
    }
  }
  std::vector<std::size_t> roots;
  for (std::size_t n = 0; n < count; ++n)
    if (!graph.parent[n]) roots.push_back(n);
  const std::vector<std::size_t> all = list_below(roots, graph.children);
  if (all.size() < count) {
    std::vector<bool> is_reached(count, false);
    for (const std::size_t n : all) is_reached[n] = true;
    const std::size_t n = std::find(is_reached.begin(), is_reached.end(), false) - is_reached.begin();
    graph.nodes[n].fail("children", fmt::format("node {} is its own ancestor, or below one that is; export it again", n));
  }
  for (const std::size_t n : all) {
    const Matrix own = read_transform(graph.nodes[n]);
    graph.global[n] = graph.parent[n] ? multiply(graph.global[*graph.parent[n]], own) : own;
    if (!std::all_of(graph.global[n].begin(), graph.global[n].end(), [](double x) { return std::isfinite(x); }))
      graph.nodes[n].fail("", "its transform is not finite; export it again");
  }
  std::vector<base::Object> scenes = root.objects("scenes");
  if (scenes.empty()) {
    graph.in_scene = all;
    return graph;
  }
  base::Object& scene = scenes[find_index(root, "scene", scenes.size(), "scene").value_or(0)];
  std::vector<std::size_t> shown = read_nodes(scene, "nodes", count);
  for (const std::size_t n : shown)
    if (graph.parent[n])
      scene.fail("nodes", fmt::format("names node {}, which is a child of node {}; export it again", n, *graph.parent[n]));
  std::vector<std::size_t> once = shown;
  std::sort(once.begin(), once.end());
  if (std::adjacent_find(once.begin(), once.end()) != once.end()) scene.fail("nodes", "names a node twice; export it again");
  graph.in_scene = list_below(shown, graph.children);
  return graph;
}

Matrix read_transform(base::Object& node) {
  if (node.has("matrix")) return node.numbers<16>("matrix");
  const auto t = node.numbers_or<3>("translation", {0, 0, 0}), s = node.numbers_or<3>("scale", {1, 1, 1});
  auto q = node.numbers_or<4>("rotation", {0, 0, 0, 1});
  const double length = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  if (!(length > 0)) node.fail("rotation", "is not a rotation; it must be a unit quaternion");
  for (double& x : q) x /= length;
  const auto [x, y, z, w] = q;
  return {s[0] * (1 - 2 * (y * y + z * z)),
          s[0] * 2 * (x * y + z * w),
          s[0] * 2 * (x * z - y * w),
          0,
          s[1] * 2 * (x * y - z * w),
          s[1] * (1 - 2 * (x * x + z * z)),
          s[1] * 2 * (y * z + x * w),
          0,
          s[2] * 2 * (x * z + y * w),
          s[2] * 2 * (y * z - x * w),
          s[2] * (1 - 2 * (x * x + y * y)),
          0,
          t[0],
          t[1],
          t[2],
          1};
}

}  // namespace carillon::gltf
