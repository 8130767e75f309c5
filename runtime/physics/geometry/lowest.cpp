// Method: tree of vertices, the lower ball first; all corners of a polyhedron. Candidates of a direction cell are the vertices that are,
// along the central direction of the cell, higher than the lowest vertex and than their neighbours by at most the cell's angle times the
// distance.
#include "runtime/physics/geometry/lowest.hpp"

#include <limits>
#include <tuple>
#include <utility>

#include "runtime/physics/geometry/mesh.hpp"
#include "runtime/physics/geometry/polyhedron.hpp"
#include "runtime/physics/geometry/search.hpp"
#include "runtime/physics/geometry/skin.hpp"

namespace carillon::geometry {
namespace {

constexpr double kRounding = 1e-9;  // relative to the distance

/// Lowest vertex along `up` (mesh frame), and its height.
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

LowVertices::Cell LowVertices::find_cell(const Vec3& up) {
  Cell cell;
  for (int k = 1; k < 3; ++k)
    if (std::abs(up[k]) > std::abs(up[cell.axis])) cell.axis = k;
  cell.sign = up[cell.axis] > 0.0 ? 1 : 0;
  const double scale = 0.5 * kSide / std::abs(up[cell.axis]);
  for (int k = 0; k < 2; ++k) cell.rows[k] = std::clamp(static_cast<int>(0.5 * kSide + scale * up[(cell.axis + 1 + k) % 3]), 0, kSide - 1);
  return cell;
}

/// Unit direction within a cell, from (0, 0) at one corner to (1, 1) at the opposite one.
Vec3 LowVertices::make_way(const Cell& cell, double x, double y) {
  Vec3 way{};
  way[cell.axis] = cell.sign > 0 ? 1.0 : -1.0;
  way[(cell.axis + 1) % 3] = 2.0 * (cell.rows[0] + x) / kSide - 1.0;
  way[(cell.axis + 2) % 3] = 2.0 * (cell.rows[1] + y) / kSide - 1.0;
  return normalise(way);
}

void LowVertices::fill(const Shape& shape, const Cell& cell, std::vector<int>& low) {
  const Mesh& mesh = shape.mesh();
  const Samples& s = shape.samples();
  const Vec3 middle = make_way(cell, 0.5, 0.5);
  double lean = 0.0;  // largest distance between a unit direction of the cell and its central one
  for (const double x : {0.0, 1.0})
    for (const double y : {0.0, 1.0}) lean = std::max(lean, norm(make_way(cell, x, y) - middle) + kRounding);
  const auto [lowest, height] = find_lowest_vertex(mesh, s, middle);
  const Vec3& at = mesh.vertices[lowest];
  const auto is_below = [&](int vertex, const Vec3& other) {
    const Vec3 d = mesh.vertices[vertex] - other;
    const double rise = dot(middle, d);
    return rise <= 0.0 || rise * rise <= lean * lean * norm2(d);
  };
  const auto may_be_lowest = [&](int vertex) {
    if (!is_below(vertex, at)) return false;
    const int start = mesh.any_half_edge[vertex];
    int e = start;
    do {
      const int other = mesh.vertex_of(Mesh::next(e));
      if (!is_below(vertex, mesh.vertices[other]) && shape.skin().kind(other) != VertexKind::none) return false;
      e = Mesh::next(mesh.opposite[e]);
    } while (e != start);
    return true;
  };
  for_near(
      s.vertex_tree,
      [&, h = height](const Ball& ball) {
        return dot(middle, ball.middle) - ball.radius_m > h + lean * (norm(ball.middle - at) + ball.radius_m);
      },
      [&](int i) {
        if (may_be_lowest(s.vertices[i])) low.push_back(s.vertices[i]);
      });
}

const std::vector<int>& LowVertices::list(const Shape& shape, const Vec3& up) {
  const Cell cell = find_cell(up);
  std::vector<int>& low = low_[((2 * cell.axis + cell.sign) * kSide + cell.rows[0]) * kSide + cell.rows[1]];
  if (low.empty()) fill(shape, cell, low);
  return low;
}

std::pair<int, double> LowVertices::find(const Shape& shape, const Vec3& up) {
  std::pair<int, double> lowest{-1, std::numeric_limits<double>::infinity()};
  for (const int vertex : list(shape, up))
    if (const double h = dot(up, shape.mesh().vertices[vertex]); h < lowest.second) lowest = {vertex, h};
  return lowest;
}

bool may_tip(const Shape& a, const Frame& frame, const Vec3& normal, const Vec3& spin, std::span<const Vec3> touches, double far_m,
             double time_s) {
  const Vec3 up = turn_back(frame.rotation, normal), turned = up + time_s * turn_back(frame.rotation, cross(normal, spin));
  const Vec3 &first = touches.front(), along = touches.back() - first;
  const auto tips = [&](int vertex) {
    const Vec3 from = a.mesh().vertices[vertex] - first;
    if (dot(turned, from) > 0.0) return false;
    const double part = norm2(along) > 0.0 ? std::clamp(dot(from, along) / norm2(along), 0.0, 1.0) : 0.0;
    return norm2(from - part * along) > far_m * far_m;
  };
  // `up` may leave its cell within the time.
  const std::vector<int>&now = a.low_vertices().list(a, up), &then = a.low_vertices().list(a, normalise(turned));
  return std::any_of(now.begin(), now.end(), tips) || (&then != &now && std::any_of(then.begin(), then.end(), tips));
}

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
    std::tie(low.place, low.gap_m) = a.low_vertices().find(a, up);
  }
  low.gap_m += frame.position_m[2] - height_m;
  return low;
}

}  // namespace carillon::geometry
