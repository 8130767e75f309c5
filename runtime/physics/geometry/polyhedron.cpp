// Method: regions of coplanar faces become facets, corners of the skin become corners, ordered about the facet normal.
#include "runtime/physics/geometry/polyhedron.hpp"

#include <map>
#include <utility>

namespace carillon::geometry {

std::optional<Polyhedron> make_polyhedron(const Mesh& mesh, const Skin& skin, int max) {
  constexpr double kConvexityRatio = 1e-6;  // fraction of the size
  if (skin.count_regions() > max || skin.count_smooth_edges() > 0) return std::nullopt;
  Polyhedron body;
  const double slack = kConvexityRatio * norm(mesh.box.high - mesh.box.low);
  std::vector<int> corner_of(mesh.vertices.size(), -1);
  for (int v = 0; v < mesh.count_vertices(); ++v) {
    if (skin.kind(v) == VertexKind::none) continue;
    if (skin.kind(v) != VertexKind::corner) return std::nullopt;
    corner_of[v] = static_cast<int>(body.corners.size());
    body.corners.push_back(mesh.vertices[v]);
    body.corner_vertices.push_back(v);
    body.middle = body.middle + mesh.vertices[v];
  }
  body.middle = (1.0 / static_cast<double>(body.corners.size())) * body.middle;
  const int facets = skin.count_regions();
  body.normals.assign(facets, Vec3{});
  body.offsets_m.assign(facets, -Box::kFar);
  body.loops.assign(facets, {});
  for (int f = 0; f < mesh.count_faces(); ++f) {
    const int r = skin.region(f);
    body.normals[r] = body.normals[r] + cross(mesh.corner(f, 1) - mesh.corner(f, 0), mesh.corner(f, 2) - mesh.corner(f, 0));
    for (int k = 0; k < 3; ++k) {
      const int c = corner_of[mesh.vertex_of(3 * f + k)];
      auto& loop = body.loops[r];
      if (c >= 0 && std::find(loop.begin(), loop.end(), c) == loop.end()) loop.push_back(c);
    }
  }
  std::map<std::pair<int, int>, int> found;  // half-edges of loops and their facet
  for (int r = 0; r < facets; ++r) {
    Vec3& n = body.normals[r];
    auto& loop = body.loops[r];
    if (loop.size() < 3) return std::nullopt;
    n = normalise(n);
    Vec3 middle{};
    for (const int c : loop) {
      body.offsets_m[r] = std::max(body.offsets_m[r], dot(n, body.corners[c]));
      middle = middle + (1.0 / static_cast<double>(loop.size())) * body.corners[c];
    }
    for (const Vec3& x : body.corners)
      if (dot(n, x) > body.offsets_m[r] + slack) return std::nullopt;
    const Vec3 s = normalise(body.corners[loop[0]] - middle), t = cross(n, s);
    const auto angle = [&](int c) { return std::atan2(dot(body.corners[c] - middle, t), dot(body.corners[c] - middle, s)); };
    std::sort(loop.begin() + 1, loop.end(), [&](int c, int d) {
      const double a = angle(c), b = angle(d);
      return (a < 0 ? a + 7 : a) < (b < 0 ? b + 7 : b);
    });
    for (std::size_t i = 0; i < loop.size(); ++i) found[{loop[i], loop[(i + 1) % loop.size()]}] = r;
  }
  for (const auto& [pair, facet] : found) {
    const auto back = found.find({pair.second, pair.first});
    if (back == found.end()) return std::nullopt;  // not a convex polyhedron
    if (pair.first > pair.second) continue;
    Polyhedron::Edge edge;
    edge.corners = {pair.first, pair.second};
    edge.facets = {facet, back->second};
    edge.length = norm(body.corners[pair.second] - body.corners[pair.first]);
    edge.along = normalise(body.corners[pair.second] - body.corners[pair.first]);
    edge.arc = cross(body.normals[edge.facets[0]], body.normals[edge.facets[1]]);
    body.edges.push_back(edge);
  }
  body.loop_edges.resize(facets);
  for (int r = 0; r < facets; ++r) {
    const auto& loop = body.loops[r];
    for (std::size_t i = 0; i < loop.size(); ++i) {
      const auto ends = std::minmax(loop[i], loop[(i + 1) % loop.size()]);
      for (std::size_t e = 0; e < body.edges.size(); ++e)
        if (body.edges[e].corners[0] == ends.first && body.edges[e].corners[1] == ends.second)
          body.loop_edges[r].push_back(static_cast<int>(e));
    }
  }
  if (body.corners.size() + body.normals.size() != body.edges.size() + 2) return std::nullopt;  // Euler's formula
  return body;
}

}  // namespace carillon::geometry
