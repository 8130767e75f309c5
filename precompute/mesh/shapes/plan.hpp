// Number of cells of a body's lattice (private to carillon::shapes).
#pragma once

#include <array>
#include <functional>
#include <optional>
#include <vector>

#include "precompute/mesh/tet_mesh.hpp"

namespace carillon::shapes {

/// Simplex counts of a linear tetrahedral mesh.
struct Counts {
  long long vertices = 0;
  long long tets = 0;
  long long boundary_triangles = 0;
  long long euler = 1;  // Euler characteristic of the body: ball 1, ring 0, closed shell 2
};

/// Nodes of a mesh: vertices, and for order 2 the edges, by Euler's formula E = V + T + F_boundary / 2 - euler.
long long calc_node_count(const Counts& counts, int order);

/// Cells along up to four independent directions; 1 in unused directions.
using Divisions = std::array<int, 4>;

/// A body before its divisions are chosen.
struct Body {
  std::array<double, 4> lengths{};  // [m] along each direction; 0 for an unused direction
  Divisions coarsest{1, 1, 1, 1};   // minimum cells of a valid mesh
  Divisions wanted{1, 1, 1, 1};     // minimum cells of a good mesh, if the count permits
  std::function<Counts(const Divisions&)> calc_counts;
  std::function<mesh::TetMesh(const Divisions&)> make;  // builds the mesh of the requested order
  double reluctance = 0.0;  // penalty relative to other constructions of the body; 0.1 equals a count error of 1 %
};

/// Chooses a construction and its divisions for an edge length (first construction only) or a node count (exactly one is given) and makes
/// the mesh. Throws InputError when out of range.
mesh::TetMesh make_best(const std::vector<Body>& bodies, int order, std::optional<long long> target_nodes, std::optional<double> edge_m);

// Bodies. Dimensions are validated; order is 1 or 2.
Body plan_box(const std::array<double, 3>& edges_m, int order);
Body plan_hollow_box(const std::array<double, 3>& edges_m, double wall_m, int order);
Body plan_tube(double length_m, double outer_radius_m, double wall_m, int order);
/// Constructions on several polyhedra, icosahedron first: its symmetry keeps the five-fold modes of a ball degenerate.
std::vector<Body> plan_ball(double radius_m, int order);
/// Cylinder along x; disc in the x-y plane; cone along z with top radius top_radius_m (0: pointed); ring of round section about z.
std::vector<Body> plan_cylinder(double length_m, double radius_m, int order);
std::vector<Body> plan_disc(double radius_m, double thickness_m, int order);
std::vector<Body> plan_cone(double radius_m, double top_radius_m, double height_m, int order);
std::vector<Body> plan_ring(double radius_m, double thickness_m, int order);
/// The part of a spherical shell within `half_angle_rad` of the lower pole; pi makes it closed.
Body plan_shell(double outer_radius_m, double wall_m, double half_angle_rad, int order);

}  // namespace carillon::shapes
