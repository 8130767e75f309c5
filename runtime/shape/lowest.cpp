// Method: the tree of vertices, the lower of two balls first; of a polyhedron all corners.
#include <limits>
#include <tuple>
#include <utility>

#include "runtime/shape/mesh.hpp"
#include "runtime/shape/polyhedron.hpp"
#include "runtime/shape/search.hpp"

namespace carillon::shape {
namespace {

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

}  // namespace carillon::shape
