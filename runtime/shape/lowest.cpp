// Method: the tree of vertices, the lower of two balls first; of a polyhedron all corners. For directions within an angle of a first one
// few
//   vertices can be lowest: those no higher than the lowest vertex and than their neighbours by that angle times the distance.
#include <limits>
#include <tuple>
#include <utility>

#include "runtime/shape/mesh.hpp"
#include "runtime/shape/polyhedron.hpp"
#include "runtime/shape/search.hpp"
#include "runtime/shape/skin.hpp"

namespace carillon::shape {
namespace {

constexpr double kLean = 0.05;            // rad
constexpr double kLeans = 0.999 * kLean;  // with room for rounding
constexpr double kTurns = 0.25 * kLean;   // turn between two calls beyond which memory does not pay

/// The vertex that is lowest along `up` (mesh frame), and its height.
std::pair<int, double> find_lowest_vertex(const Mesh& mesh, const Samples& s, const Vec3& up) {
  std::pair<int, double> lowest{-1, std::numeric_limits<double>::infinity()};
  std::vector<int> open{0};
  while (!open.empty()) {
    const Ball& ball = s.vertex_tree[open.back()];
    open.pop_back();
    if (dot(up, ball.middle) - ball.radius_m >= lowest.second) continue;
    if (ball.child >= 0) {
      const bool second = dot(up, s.vertex_tree[ball.child + 1].middle) < dot(up, s.vertex_tree[ball.child].middle);
      open.push_back(ball.child + (second ? 0 : 1));
      open.push_back(ball.child + (second ? 1 : 0));
      continue;
    }
    for (int i = ball.first; i < ball.first + ball.count; ++i)
      if (const double h = dot(up, mesh.vertices[s.vertices[i]]); h < lowest.second) lowest = {s.vertices[i], h};
  }
  return lowest;
}

/// Candidates for the lowest vertex along directions within kLean of `up`.
void find_low_vertices(const Mesh& mesh, const Skin& skin, const Samples& s, const Vec3& up, std::vector<int>& low) {
  low.clear();
  const auto [lowest, height] = find_lowest_vertex(mesh, s, up);
  const Vec3& at = mesh.vertices[lowest];
  const auto is_below = [&](int vertex, const Vec3& other) {
    const Vec3 d = mesh.vertices[vertex] - other;
    const double rise = dot(up, d);
    return rise <= 0.0 || rise * rise <= kLean * kLean * norm2(d);
  };
  const auto may_be_lowest = [&](int vertex) {
    if (!is_below(vertex, at)) return false;
    const int start = mesh.any_half_edge[vertex];
    int e = start;
    do {
      const int other = mesh.vertex_of(Mesh::next(e));
      if (skin.kind(other) != VertexKind::none && !is_below(vertex, mesh.vertices[other])) return false;
      e = Mesh::next(mesh.opposite[e]);
    } while (e != start);
    return true;
  };
  for_near(
      s.vertex_tree,
      [&](const Ball& ball) { return dot(up, ball.middle) - ball.radius_m > height + kLean * (norm(ball.middle - at) + ball.radius_m); },
      [&](int i) {
        if (may_be_lowest(s.vertices[i])) low.push_back(s.vertices[i]);
      });
}

}  // namespace

double calc_vertex_curvature(const Shape& shape, int vertex) {
  const Skin& skin = shape.skin();
  const int face = skin.find_face(vertex);
  if (shape.is_polyhedron()) return get_sharp_curvature(shape, VertexKind::corner);
  if (skin.kind(vertex) != VertexKind::smooth || skin.is_flat(face)) return get_sharp_curvature(shape, skin.kind(vertex));
  Vec3 at{};
  for (int k = 0; k < 3; ++k) at[k] = shape.mesh().vertex_of(3 * face + k) == vertex ? 1.0 : 0.0;
  return skin.calc_mean_curvature(face, at);
}

Deepest find_lowest(const Shape& a, const Frame& frame, double height_m) {
  const Vec3& up = frame.rotation[2];
  Deepest low{.gap_m = std::numeric_limits<double>::infinity()};
  if (const Polyhedron* body = a.polyhedron()) {
    for (std::size_t c = 0; c < body->corners.size(); ++c)
      if (const double h = dot(up, body->corners[c]); h < low.gap_m) low = {body->corner_vertices[c], h};
  } else {
    std::tie(low.place, low.gap_m) = find_lowest_vertex(a.mesh(), a.samples(), up);
  }
  low.gap_m += frame.position_m[2] - height_m;
  return low;
}

Deepest find_lowest(const Shape& a, const Frame& frame, double height_m, PairMemory& memory) {
  const Vec3 &up = frame.rotation[2], before = std::exchange(memory.up, up);
  if (a.is_polyhedron() || norm2(up - before) > kTurns * kTurns) return find_lowest(a, frame, height_m);
  if (memory.low.empty() || norm2(up - memory.low_up) > kLeans * kLeans) {
    memory.low_up = up;
    find_low_vertices(a.mesh(), a.skin(), a.samples(), up, memory.low);
  }
  Deepest low{.gap_m = std::numeric_limits<double>::infinity()};
  for (const int vertex : memory.low)
    if (const double h = dot(up, a.mesh().vertices[vertex]); h < low.gap_m) low.place = vertex, low.gap_m = h;
  low.gap_m += frame.position_m[2] - height_m;
  return low;
}

}  // namespace carillon::shape
