// Convex polyhedron of few facets, independent of the fineness of its mesh.
#pragma once

#include <optional>
#include <vector>

#include "runtime/physics/geometry/skin.hpp"

namespace carillon::geometry {

struct Polyhedron {
  struct Edge {
    std::array<int, 2> corners{}, facets{};
    double length = 0.0;
    Vec3 along{}, arc{};  // unit; cross product of the facet normals, parallel to the edge
  };
  std::vector<Vec3> corners;
  std::vector<int> corner_vertices;          // indices in the mesh
  std::vector<Vec3> normals;                 // of facets
  std::vector<double> offsets_m;             // normal . x on the facet
  std::vector<std::vector<int>> loops;       // corners of each facet, counterclockwise from outside
  std::vector<std::vector<int>> loop_edges;  // edge from each corner of a loop to the next
  std::vector<Edge> edges;
  Vec3 middle{};
};

/// Returns nullopt if the body is not convex, has curved parts, or has more than `max` facets.
std::optional<Polyhedron> make_polyhedron(const Mesh& mesh, const Skin& skin, int max);

}  // namespace carillon::geometry
