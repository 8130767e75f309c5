// A convex polyhedron of few facets, whatever the fineness of the mesh it came from.
#pragma once

#include <optional>
#include <vector>

#include "runtime/physics/geometry/skin.hpp"

namespace carillon::geometry {

struct Polyhedron {
  struct Edge {
    std::array<int, 2> corners{}, facets{};
    double length = 0.0;
    Vec3 along{}, arc{};  // unit; cross product of the facets' normals, which is along the edge
  };
  std::vector<Vec3> corners;
  std::vector<int> corner_vertices;          // of the mesh
  std::vector<Vec3> normals;                 // of facets
  std::vector<double> offsets_m;             // normal . x on the facet
  std::vector<std::vector<int>> loops;       // corners of a facet, counterclockwise from outside
  std::vector<std::vector<int>> loop_edges;  // the edge from a corner of a loop to the next
  std::vector<Edge> edges;
  Vec3 middle{};
};

/// Nothing where the body is not convex, has curved parts, or more than `max` facets.
std::optional<Polyhedron> make_polyhedron(const Mesh& mesh, const Skin& skin, int max);

}  // namespace carillon::geometry
