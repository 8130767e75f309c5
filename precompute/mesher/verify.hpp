// Whether a mesh is the body it was made of.
#pragma once

#include <cstdint>
#include <string>

#include "precompute/mesher/body.hpp"

namespace carillon::mesher {

/// How many closed surfaces the body's boundary has: those that elements of this length must show, and all there are.
struct Shells {
  std::int64_t min = 0, max = 0;
};
Shells count_shells(const Body& body, double edge_m);

/// Of a body that is known by its distance field alone: what its elements cannot show, since not even the field does, as the end of a
/// sentence "the mesh ...". Empty if there is nothing, or no field.
std::string find_lost(const Body& body, double edge_m);

/// How thin the solid in a distance field is at its thinnest place: twice the depth of the least deep sample from which the surface is
/// equally near in two directions more than 100 degrees apart. Places deeper than the field reaches count as that deep, those thinner than
/// three samples as three. The edges of a box are no thin place.
double calc_least_thickness(const DistanceField& field);

/// Why stuffing with these edges does not show the body, as the end of a sentence "the mesh ..."; empty if it does: its cells must be a
/// third of the least thickness, and the mesh as long as the body within 0.2 %. Else it ends short of tips, which no error bar knows.
/// `field` reaches two edges into the body.
std::string find_cut(const mesh::TetMesh& linear, const Body& body, double edge_m);

/// What the mesh is compared with, beyond the body.
struct Expectation {
  double edge_m = 0;
  double volume_m3 = 0;
  Shells shells;
};

struct Comparison {
  double volume_m3 = 0;
  std::int64_t shells = 0;
  double farthest_outside_m = 0;
  std::string fault = {};    // empty: the mesh is the body; else what is off, as the end of a sentence "the mesh ..."
  bool is_hopeless = false;  // slightly shorter edges will not help: a part, or the hollow, is missing, or elements have no volume
};

/// Compares a linear mesh with the body. Off is: an element without volume (mesh::count_flat); a volume that differs by more than 3 % and
/// what facets a tenth of an edge off the skin would take away from a solid (8 % and a third of that for a wall); a node farther outside,
/// or inside the hollow, than a tenth of an edge and half a sample of the distance field; other shells than expected; an extent that falls
/// short by a tenth and by two edges: a part that is thinner than the elements is missing.
Comparison compare(const mesh::TetMesh& linear, const Body& body, const Expectation& expectation);

}  // namespace carillon::mesher
