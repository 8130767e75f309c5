#include "runtime/physics/geometry/facing.hpp"

#include "runtime/physics/geometry/search.hpp"

namespace carillon::geometry {

double calc_skin_gap(const Shape& shape, const Vec3& x, const Nearest& at, bool is_inside) {
  const Skin& skin = shape.skin();
  const Mesh& mesh = shape.mesh();
  const auto calc_height = [&](int face, const Vec3& w) { return dot(skin.calc_normal(face, w), x - skin.calc_point(face, w)); };
  double gap = skin.is_flat(at.face) ? (is_inside ? -1.0 : 1.0) * std::sqrt(at.distance2) : calc_height(at.face, at.weights);
  // At round holes the mesh protrudes from the skin: inside means below both sides of the edge.
  for (int e = 3 * at.face; e < 3 * at.face + 3 && gap < 0.0; ++e) {
    const int other = mesh.opposite[e] / 3;
    if (skin.is_sharp(e) && !skin.is_flat(other) && mesh.is_convex(e))
      gap = std::max(gap, calc_height(other, mesh.find_nearest_on_face(x, other).weights));
  }
  return gap;
}

Facing describe(const Mesh& mesh, const Skin& skin, const Nearest& at) {
  const auto [zeros, start] = find_feature(at.face, at.weights);
  if (zeros == 2) {
    const int v = mesh.vertex_of(start);
    if (skin.kind(v) == VertexKind::corner) return {Side::point, {}, v};
    // Point within an edge: follow the sharp edge.
    for (int e = start;;) {
      if (skin.is_sharp(e)) return {Side::line, normalise(mesh.vertices[mesh.vertex_of(Mesh::next(e))] - mesh.vertices[v]), v};
      e = Mesh::next(mesh.opposite[e]);
      if (e == start) break;
    }
  }
  if (zeros == 1 && skin.is_sharp(start))
    return {Side::line, normalise(mesh.vertices[mesh.vertex_of(Mesh::next(start))] - mesh.vertices[mesh.vertex_of(start)]), -1};
  if (skin.is_flat(at.face)) return {Side::plane, mesh.normals[at.face], -1};
  return {Side::skin, {}, -1};
}

Vec3 find_normal(const Shape& shape, int face, const Vec3& x) {
  return shape.skin().calc_normal(face, shape.mesh().find_nearest_on_face(x, face).weights);
}

Vec3 find_into(const Shape& shape, const Ridge& ridge, int side, const Vec3& x) {
  const int face = ridge.faces[side];
  if (shape.skin().is_flat(face)) return ridge.into[side];
  const Vec3 n = find_normal(shape, face, x);
  return normalise(side == 0 ? cross(n, ridge.along) : cross(ridge.along, n));
}

}  // namespace carillon::geometry
