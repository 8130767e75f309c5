// Radiating surface for boundary elements: flat facets with the midpoints of their edges.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "runtime/base/triangle.hpp"
#include "runtime/base/vector.hpp"

namespace carillon::air {

/// Surface triangle. The curl of the hat function of corner c on it is the constant curl[c] [1/m].
struct Facet {
  Triangle corners{};                    // nodes
  std::array<std::int32_t, 3> points{};  // midpoint of the edge opposite each corner
  Vec3 normal{};                         // unit, into the air
  double area_m2 = 0.0;
  double size_m = 0.0;  // longest edge
  std::array<Vec3, 3> curl{};
};

/// Edge midpoint. Products of two hat functions are integrated exactly by the three midpoints, each with a third of the area.
struct EdgePoint {
  Vec3 place_m{};
  std::array<std::int32_t, 2> nodes{};
  double size_m = 0.0;  // smallest size of the adjacent facets
};

/// Closed, oriented surfaces with N nodes, T facets and E = 3 T / 2 edges. Invariant: facets close in the list are close in space; nodes
/// and edges are numbered in the order of the facets; no facet has zero area.
class RadiatingSurface {
 public:
  /// Renumbers nodes and facets. Throws InputError for non-finite numbers and if all facets are degenerate.
  RadiatingSurface(std::span<const Vec3> nodes_m, std::span<const Triangle> triangles);

  const std::vector<Vec3>& get_nodes() const { return nodes_m_; }
  const std::vector<Facet>& get_facets() const { return facets_; }
  const std::vector<EdgePoint>& get_points() const { return points_; }
  /// (T) numbers in the constructor's input.
  const std::vector<std::int32_t>& get_facet_sources() const { return facet_source_; }
  std::size_t count_nodes() const { return nodes_m_.size(); }
  std::size_t count_facets() const { return facets_.size(); }
  std::size_t count_points() const { return points_.size(); }
  double calc_area_m2() const;
  double calc_volume_m3() const;

 private:
  std::vector<Vec3> nodes_m_;
  std::vector<Facet> facets_;
  std::vector<EdgePoint> points_;
  std::vector<std::int32_t> facet_source_;
};

/// Sphere around points.
struct Sphere {
  Vec3 centre_m{};
  double radius_m = 0.0;
};

/// Smallest sphere around the points, to 1e-9 of its radius; at least one point.
Sphere find_enclosing_sphere(std::span<const Vec3> points_m);

/// Orders items so that each consecutive run of `run` items is compact: recursive bisection along the longest side.
std::vector<std::int32_t> order_by_place(std::span<const Vec3> places_m, std::size_t run);

}  // namespace carillon::air
