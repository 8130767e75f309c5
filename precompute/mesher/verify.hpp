// Verifies that a mesh represents the body it was made from.
#pragma once

#include <cstdint>
#include <string>

#include "precompute/mesher/body.hpp"

namespace carillon::mesher {

/// Number of closed surfaces of the body's boundary: those that elements of this length must resolve, and all.
struct Shells {
  std::int64_t min = 0, max = 0;
};
Shells count_shells(const Body& body, double edge_m);

/// For a body given by its distance field only: features not resolved by the field, completing a sentence "the mesh ..."; empty if none, or
/// without a field.
std::string find_lost(const Body& body, double edge_m);

/// Least thickness of the solid in a distance field: twice the depth of the least deep sample that has equally near surface in two
/// directions more than 100 degrees apart. Depth is limited by the field's reach; at least three samples. Edges of a box do not count as
/// thin.
double calc_least_thickness(const DistanceField& field);

/// Reason why stuffing with these edges misrepresents the body, completing "the mesh ..."; empty if it does not: cells of at most a third
/// of the least thickness, and mesh extents within 0.2 %. Otherwise tips are cut, which no error bar includes. `field` reaches two edges
/// into the body.
std::string find_cut(const mesh::TetMesh& linear, const Body& body, double edge_m);

/// Reference values beyond the body.
struct Expectation {
  double edge_m = 0;
  double volume_m3 = 0;
  Shells shells;
};

struct Comparison {
  double volume_m3 = 0;
  std::int64_t shells = 0;
  double farthest_outside_m = 0;
  std::string fault = {};    // empty: the mesh is correct; else the deviation, completing "the mesh ..."
  bool is_hopeless = false;  // slightly shorter edges will not help: a part or the hollow is missing, or elements have zero volume
};

/// Compares a linear mesh with the body. Faults: zero-volume element (mesh::count_flat); volume error above 3 % plus the effect of facets a
/// tenth of an edge off a solid's skin (8 % and a third of that for a wall); node outside, or in the hollow, by more than a tenth of an
/// edge and half a field sample; unexpected number of shells; extent short by a tenth and by two edges (a part thinner than the elements is
/// missing).
Comparison compare(const mesh::TetMesh& linear, const Body& body, const Expectation& expectation);

}  // namespace carillon::mesher
